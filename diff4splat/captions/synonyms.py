"""Other words for the nouns, colours, sides and verbs of captions."""

from functools import lru_cache

ANY_OBJECT = ("object", "thing")
"""Name an object together with its colour."""
NOUN_SYNONYMS: dict[str, tuple[str, ...]] = {
    "arch": ("archway", "gate"),
    "ball": ("sphere",),
    "banner": ("poster",),
    "barrel": ("cask",),
    "bench": ("park bench",),
    "bookcase": ("bookshelf", "shelf"),
    "bottle": ("flask",),
    "bowl": ("dish",),
    "box": ("cube", "carton"),
    "building": ("high-rise",),
    "bush": ("shrub",),
    "capsule": ("pill",),
    "car": ("vehicle", "automobile"),
    "caterpillar": ("worm",),
    "chair": ("armchair",),
    "crate": ("wooden box", "chest"),
    "cylinder": ("tin", "can"),
    "drum": ("tub",),
    "fence": ("railing",),
    "fir tree": ("pine", "conifer"),
    "flag": ("pennant",),
    "flight of steps": ("stairs", "staircase"),
    "flower": ("blossom",),
    "four-legged animal": ("animal", "dog", "cat", "horse", "cow", "sheep"),
    "gear": ("cogwheel",),
    "house": ("hut", "cottage"),
    "lamp": ("light",),
    "mug": ("cup", "coffee cup", "tea cup"),
    "pillar": ("column", "post"),
    "potted plant": ("plant", "pot plant"),
    "robot arm": ("robot",),
    "rock": ("stone", "boulder"),
    "rounded block": ("block", "brick"),
    "snake": ("serpent",),
    "sofa": ("couch",),
    "stack of books": ("books", "pile of books"),
    "stool": ("seat",),
    "street lamp": ("lamp post", "lantern"),
    "table": ("desk",),
    "torus": ("ring", "doughnut", "tyre"),
    "towel": ("cloth",),
    "tuft of grass": ("grass",),
    "vase": ("jug", "pot"),
}
COLOR_SYNONYMS: dict[str, tuple[str, ...]] = {
    "beige": ("tan", "cream"),
    "grey": ("gray", "silver"),
    "purple": ("violet",),
    "red": ("crimson",),
    "turquoise": ("teal", "cyan"),
    "yellow": ("golden",),
}
SIDES: dict[str, tuple[str, ...]] = {
    "left": ("to the left", "left", "leftward", "leftwards", "toward the left", "to the left side"),
    "right": (
        *("to the right", "right", "rightward", "rightwards", "toward the right"),
        "to the right side",
    ),
    "toward": (
        *("toward the camera", "towards us", "closer", "nearer", "forward", "toward the viewer"),
        "to the front",
    ),
    "away": (
        *("away from the camera", "away", "backward", "into the distance", "farther away"),
        *("away from us", "to the back"),
    ),
}
"""Phrases for each direction of ``vocabulary.DIRECTIONS``, which come first."""
TRAVEL_VERBS = (
    ("moves", "move", "moving"),
    ("slides", "slide", "sliding"),
    ("glides", "glide", "gliding"),
    ("goes", "go", "going"),
    ("travels", "travel", "travelling"),
    ("drifts", "drift", "drifting"),
    ("shifts", "shift", "shifting"),
)
"""Third person, infinitive and participle."""


def names(noun: str) -> tuple[str, ...]:
    """The noun and its synonyms."""
    return (noun, *NOUN_SYNONYMS.get(noun, ()))


def may_be_confused(noun: str, other: str) -> bool:
    """Whether one name fits both: a street lamp is a lamp."""
    return not _last_words(noun).isdisjoint(_last_words(other))


@lru_cache(4096)
def _last_words(noun: str) -> frozenset[str]:
    """Of all its names; asked a hundred times for every prompt of training."""
    return frozenset(name.split()[-1] for name in names(noun))
