"""The words of captions: every phrase belongs to one motion, direction, place or camera move."""

from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES

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
PLACES = {name: kind.phrase for name, kind in SCENE_KINDS.items()}
NOUNS = tuple(sorted({family.noun for family in FAMILIES.values()}))
