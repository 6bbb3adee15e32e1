"""All object families: how they are made, how high they are, and what they can do.

``heights_m`` are the natural heights, several ranges where an object also exists as a toy.
``abilities`` are what motions ask for; ``places`` say where an object is put when it does not move.
"""

from collections.abc import Callable
from dataclasses import dataclass

from diff4splat.captions.vocabulary import UNNAMED
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.families import (
    animals,
    buildings,
    chains,
    composites,
    furniture,
    outlines,
    people,
    plants,
    pottery,
    sheets,
    solids,
)
from diff4splat.data_prep.synthetic.shapes.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One kind of object."""

    make: Callable[[Rng], Shape]
    noun: str
    heights_m: tuple[tuple[float, float], ...]
    abilities: frozenset[str]
    places: frozenset[str]


def _family(
    make: Callable[[Rng], Shape],
    noun: str,
    heights_m: tuple[tuple[float, float], ...],
    abilities: str,
    places: str = "",
) -> Family:
    return Family(
        make=make,
        noun=noun,
        heights_m=heights_m,
        abilities=frozenset(abilities.split()),
        places=frozenset(places.split()),
    )


COMPOSITE, PERSON = "composite", "person"
OF_NO_SPLIT = frozenset({COMPOSITE, PERSON})
"""Families that only recipes with a share of them have. No word of a caption names them."""
_SOLID = "move spin hop drop soft"
_ROUND = "move hop drop soft"
FAMILIES: dict[str, Family] = {
    "box": _family(solids.make_box, "box", ((0.04, 0.9),), f"{_SOLID} tumble", "room table ground"),
    "crate": _family(
        solids.make_crate, "crate", ((0.3, 0.9),), "move spin drop tumble", "room ground street"
    ),
    "ball": _family(
        solids.make_ball,
        "ball",
        ((0.05, 1.0),),
        f"{_ROUND} roll bounce hang orbit",
        "room table ground",
    ),
    "can": _family(solids.make_can, "cylinder", ((0.06, 0.8),), _ROUND, "room table ground"),
    "cone": _family(solids.make_cone, "cone", ((0.08, 0.8),), _SOLID, "room street ground"),
    "capsule": _family(
        solids.make_capsule, "capsule", ((0.05, 0.7),), f"{_SOLID} roll bounce orbit", "room table"
    ),
    "torus": _family(
        solids.make_ring, "torus", ((0.06, 1.1),), f"{_SOLID} roll hang orbit", "room table ground"
    ),
    "block": _family(
        solids.make_block,
        "rounded block",
        ((0.05, 0.8),),
        f"{_SOLID} tumble bounce orbit",
        "room table ground",
    ),
    "drum": _family(solids.make_drum, "drum", ((0.1, 0.6),), "move hop drop", "room table"),
    "vase": _family(pottery.make_vase, "vase", ((0.12, 0.7),), "move", "room table"),
    "bowl": _family(pottery.make_bowl, "bowl", ((0.05, 0.14),), "move", "table"),
    "bottle": _family(pottery.make_bottle, "bottle", ((0.15, 0.4),), "move hop", "table"),
    "lamp": _family(pottery.make_lamp, "lamp", ((0.25, 0.6), (1.2, 1.6)), "move", "room table"),
    "mug": _family(pottery.make_mug, "mug", ((0.07, 0.13),), "move spin hop drop", "table"),
    "barrel": _family(
        pottery.make_barrel, "barrel", ((0.5, 1.1),), "move drop hop", "ground street"
    ),
    "pillar": _family(pottery.make_pillar, "pillar", ((1.6, 4.0),), "", "street ground"),
    "mushroom": _family(
        pottery.make_mushroom, "mushroom", ((0.06, 0.5),), "soft hop sway", "ground table"
    ),
    "balloon": _family(
        pottery.make_balloon, "balloon", ((0.5, 1.2),), "hang soft rise", "room ground"
    ),
    "lantern": _family(pottery.make_lantern, "street lamp", ((2.6, 4.0),), "", "street"),
    "stool": _family(
        pottery.make_stool, "stool", ((0.4, 0.7),), "move spin hop drop", "room ground"
    ),
    "pumpkin": _family(
        pottery.make_pumpkin,
        "pumpkin",
        ((0.1, 0.5),),
        f"{_ROUND} bounce",
        "table ground street room",
    ),
    "star": _family(
        outlines.make_star, "star", ((0.06, 0.8),), f"{_SOLID} tumble hang orbit", "room table"
    ),
    "gear": _family(
        outlines.make_gear, "gear", ((0.06, 0.9),), f"{_SOLID} roll tumble orbit", "table room"
    ),
    "heart": _family(
        outlines.make_heart, "heart", ((0.06, 0.7),), f"{_SOLID} hang orbit", "room table"
    ),
    "letter": _family(
        outlines.make_letter, "letter", ((0.06, 0.8),), f"{_SOLID} tumble hang", "room table"
    ),
    "tree": _family(plants.make_tree, "tree", ((2.2, 7.0),), "sway", "ground street far"),
    "conifer": _family(plants.make_conifer, "fir tree", ((1.6, 9.0),), "sway", "ground far"),
    "bush": _family(plants.make_bush, "bush", ((0.5, 1.6),), "sway", "ground street far"),
    "pot_plant": _family(
        plants.make_pot_plant,
        "potted plant",
        ((0.2, 1.1),),
        "sway move spin hop",
        "room table street",
    ),
    "grass": _family(plants.make_grass, "tuft of grass", ((0.1, 0.5),), "sway", "ground"),
    "flower": _family(plants.make_flower, "flower", ((0.2, 0.6),), "sway", "ground"),
    "rock": _family(plants.make_rock, "rock", ((0.08, 1.6),), "drop tumble", "ground table"),
    "snake": _family(chains.make_snake, "snake", ((0.03, 0.12),), "slither", "ground"),
    "caterpillar": _family(
        chains.make_caterpillar, "caterpillar", ((0.06, 0.35),), "crawl", "table room"
    ),
    "robot_arm": _family(chains.make_robot_arm, "robot arm", ((0.25, 1.3),), "arm", "table room"),
    "flag": _family(sheets.make_flag, "flag", ((1.2, 4.0), (0.2, 0.4)), "flutter", "ground street"),
    "towel": _family(sheets.make_towel, "towel", ((1.3, 2.0),), "flutter", "ground"),
    "banner": _family(
        sheets.make_banner, "banner", ((1.4, 3.5), (0.25, 0.4)), "flutter", "street ground"
    ),
    "table": _family(furniture.make_table, "table", ((0.45, 0.8), (0.08, 0.15)), "", "room"),
    "chair": _family(
        furniture.make_chair, "chair", ((0.8, 1.05), (0.12, 0.25)), "move spin hop", "room"
    ),
    "bench": _family(furniture.make_bench, "bench", ((0.75, 0.95),), "move", "ground street"),
    "shelf": _family(furniture.make_shelf, "bookcase", ((1.0, 2.0),), "", "wall"),
    "sofa": _family(furniture.make_sofa, "sofa", ((0.75, 0.95),), "", "wall"),
    "steps": _family(furniture.make_steps, "flight of steps", ((0.4, 1.0),), "", "street"),
    "books": _family(
        furniture.make_books, "stack of books", ((0.1, 0.25),), "move spin", "table room"
    ),
    "house": _family(buildings.make_house, "house", ((3.5, 8.0), (0.15, 0.35)), "", "far table"),
    "tower": _family(buildings.make_tower, "tower", ((5.0, 12.0), (0.2, 0.5)), "", "far table"),
    "flats": _family(buildings.make_block_of_flats, "building", ((6.0, 14.0),), "", "far"),
    "fence": _family(buildings.make_fence, "fence", ((0.7, 1.3),), "", "ground"),
    "arch": _family(buildings.make_arch, "arch", ((1.8, 4.0), (0.15, 0.4)), "", "street ground"),
    "wall": _family(buildings.make_wall, "wall", ((0.6, 1.4),), "", "ground street"),
    "windmill": _family(
        buildings.make_windmill, "windmill", ((3.0, 8.0), (0.3, 0.6)), "wheel", "far ground table"
    ),
    "quadruped": _family(
        animals.make_quadruped, "four-legged animal", ((0.4, 1.5),), "walk hop", "ground"
    ),
    "bird": _family(animals.make_bird, "bird", ((0.08, 0.3),), "fly", ""),
    "fish": _family(animals.make_fish, "fish", ((0.15, 0.5),), "swim", ""),
    "car": _family(
        animals.make_car, "car", ((1.3, 1.6), (0.06, 0.3)), "drive", "street ground table room"
    ),
    COMPOSITE: _family(
        composites.make_composite,
        UNNAMED,
        ((0.05, 1.2), (1.2, 5.0)),
        f"{_SOLID} tumble bounce hang orbit sway",
        "room table ground street",
    ),
    PERSON: _family(
        people.make_person, UNNAMED, ((1.0, 2.0),), "move hop sway", "room ground street"
    ),
}
