"""The words of captions.

Every phrase belongs to exactly one motion, direction, place or camera move.
"""

DIRECTIONS = {
    "left": "to the left",
    "right": "to the right",
    "toward": "toward the camera",
    "away": "away from the camera",
}
OPPOSITE = {"left": "right", "right": "left", "toward": "away", "away": "toward"}
VERBS: dict[str, tuple[str, ...]] = {
    "slides": ("slides", "glides", "moves"),
    "rolls": ("rolls", "is rolling"),
    "tumbles": ("tumbles", "tips over and over"),
    "spins": ("spins", "turns around itself"),
    "bounces": ("bounces", "bounces along"),
    "drops": ("drops from above", "falls down"),
    "hops": ("hops", "jumps"),
    "rises": ("rises", "floats upward"),
    "circles": ("moves in a circle", "goes round in a circle"),
    "swings": ("swings to and fro", "swings on a rope"),
    "walks": ("walks", "is walking"),
    "flies": ("flies", "flies with beating wings"),
    "swims": ("swims", "is swimming"),
    "slithers": ("slithers", "winds its way"),
    "crawls": ("crawls", "creeps"),
    "drives": ("drives", "is driving"),
    "reaches": ("turns and reaches out", "moves its joints"),
    "turns_sails": ("turns its sails", "has its sails turning"),
    "flutters": ("flutters in the wind", "waves in the wind"),
    "squashes": ("squashes and stretches", "pulses"),
    "grows": ("grows", "swells"),
    "shrinks": ("shrinks", "gets smaller"),
    "twists": ("twists", "twists to and fro"),
    "bends": ("bends to and fro", "bows and rises"),
    "wobbles": ("wobbles", "shakes like jelly"),
    "sways": ("sways in the wind", "sways"),
}
IN_PLACE = (
    *("spins", "reaches", "turns_sails", "flutters", "squashes", "grows", "shrinks"),
    *("twists", "bends", "wobbles", "sways"),
)
"""Motions after which an object is where it was."""
OF_PARTS = ("reaches", "turns_sails", "flutters")
"""Of these, those in which parts of an object move on their own."""
ROLLING = ("rolls", "tumbles")
"""Motions in which an object turns as far as it travels."""
CAMERA_MOVES: dict[tuple[str, int], tuple[str, ...]] = {
    ("static", 0): ("stands still", "does not move"),
    ("orbit", 1): ("circles right", "orbits to the right"),
    ("orbit", -1): ("circles left", "orbits to the left"),
    ("arc", 1): ("swings right and back", "swings to the right first"),
    ("arc", -1): ("swings left and back", "swings to the left first"),
    ("spiral", 1): ("spirals outward", "moves in a spiral"),
    ("figure8", 1): ("draws a figure eight", "moves in a figure eight"),
    ("forward", 1): ("moves forward", "pushes in"),
    ("backward", 1): ("moves back", "pulls out"),
    ("up", 1): ("rises", "moves up"),
    ("down", 1): ("sinks", "moves down"),
    ("left", 1): ("slides left", "moves to the left"),
    ("right", 1): ("slides right", "moves to the right"),
    ("roll", 1): ("rolls clockwise", "turns clockwise"),
    ("roll", -1): ("rolls counter-clockwise", "turns counter-clockwise"),
    ("dolly-zoom", 1): ("moves in while the lens widens", "dollies in and widens"),
    ("dolly-zoom", -1): ("moves back while the lens narrows", "dollies out and narrows"),
}
PLACES = {
    "room": "in a room",
    "tabletop": "on a table",
    "meadow": "in a meadow",
    "garden": "in a garden",
    "dunes": "on sand",
    "street": "in a street",
    "courtyard": "in a courtyard",
    "seabed": "under water",
}
UNNAMED = "object"
"""Name of random shapes, which no noun fits."""
NOUNS = (
    "arch",
    "ball",
    "balloon",
    "banner",
    "barrel",
    "bench",
    "bird",
    "bookcase",
    "bottle",
    "bowl",
    "box",
    "building",
    "bush",
    "capsule",
    "car",
    "caterpillar",
    "chair",
    "cone",
    "crate",
    "cylinder",
    "drum",
    "fence",
    "fir tree",
    "fish",
    "flag",
    "flight of steps",
    "flower",
    "four-legged animal",
    "gear",
    "heart",
    "house",
    "lamp",
    "letter",
    "mug",
    "mushroom",
    "pillar",
    "potted plant",
    "pumpkin",
    "robot arm",
    "rock",
    "rounded block",
    "snake",
    "sofa",
    "stack of books",
    "star",
    "stool",
    "street lamp",
    "table",
    "torus",
    "towel",
    "tower",
    "tree",
    "tuft of grass",
    "vase",
    "wall",
    "windmill",
)
UNSEEN_NOUNS = (
    *("arch", "banner", "barrel", "bottle", "caterpillar", "fir tree", "gear", "heart", "mug"),
    *("pumpkin", "stool", "windmill"),
)
"""Nouns of objects that no procedural world of training shows."""
