"""The kinds of scenes and their measures.

The stage is the circle around the origin in which objects move; its radius sets the scale of
everything else. Ranges are drawn from evenly.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneKind:
    """One kind of place."""

    area_radius_m: tuple[float, float]
    tilt_deg: tuple[float, float]
    """Tilt of the camera."""
    ground: str
    """Material role of the ground."""
    tags: frozenset[str]
    """Tags of the static families: see ``Family.places``."""
    props: tuple[int, int]
    far: frozenset[str] = frozenset()
    far_count: tuple[int, int] = (0, 0)
    is_indoors: bool = False
    is_under_water: bool = False
    hills_m: tuple[float, float] = (0.0, 0.0)
    weight: float = 1.0
    """Relative frequency."""


SCENE_KINDS: dict[str, SceneKind] = {
    "room": SceneKind(
        weight=2.0,
        tags=frozenset(["room"]),
        area_radius_m=(0.7, 1.3),
        tilt_deg=(6.0, 28.0),
        ground="floor",
        props=(4, 7),
        is_indoors=True,
    ),
    "tabletop": SceneKind(
        weight=1.5,
        tags=frozenset(["table"]),
        area_radius_m=(0.16, 0.34),
        tilt_deg=(10.0, 34.0),
        ground="wood",
        props=(4, 8),
        is_indoors=True,
    ),
    "meadow": SceneKind(
        weight=1.5,
        tags=frozenset(["ground"]),
        far=frozenset(["tree", "conifer", "house", "windmill", "bush"]),
        area_radius_m=(1.2, 3.6),
        tilt_deg=(2.0, 20.0),
        ground="lawn",
        props=(7, 14),
        far_count=(5, 9),
        hills_m=(3.0, 16.0),
    ),
    "garden": SceneKind(
        weight=1.5,
        tags=frozenset(["ground"]),
        far=frozenset(["tree", "house", "bush", "fence"]),
        area_radius_m=(0.8, 2.2),
        tilt_deg=(4.0, 24.0),
        ground="lawn",
        props=(8, 14),
        far_count=(4, 7),
        hills_m=(0.0, 3.0),
    ),
    "dunes": SceneKind(
        weight=0.7,
        tags=frozenset(["sand"]),
        far=frozenset(["conifer", "tower", "bush"]),
        area_radius_m=(1.0, 3.4),
        tilt_deg=(2.0, 20.0),
        ground="sand",
        props=(5, 10),
        far_count=(1, 4),
        hills_m=(6.0, 20.0),
    ),
    "street": SceneKind(
        weight=1.5,
        tags=frozenset(["street"]),
        far=frozenset(["house", "flats", "tree", "tower"]),
        area_radius_m=(1.4, 3.6),
        tilt_deg=(3.0, 20.0),
        ground="asphalt",
        props=(4, 8),
        far_count=(5, 8),
        hills_m=(0.0, 5.0),
    ),
    "courtyard": SceneKind(
        weight=1.5,
        tags=frozenset(["street", "ground"]),
        area_radius_m=(1.1, 2.6),
        tilt_deg=(4.0, 26.0),
        ground="paving",
        props=(5, 9),
    ),
    "seabed": SceneKind(
        weight=0.6,
        tags=frozenset(["sea"]),
        area_radius_m=(0.7, 1.8),
        tilt_deg=(2.0, 18.0),
        ground="sand",
        props=(9, 15),
        is_under_water=True,
        hills_m=(2.0, 5.0),
    ),
}

OUTSIDERS: dict[str, frozenset[str]] = {
    "sand": frozenset(
        {"rock", "grass", "bush", "barrel", "crate", "arch", "pillar", "vase", "fence"}
    ),
    "sea": frozenset({"rock", "grass", "mushroom", "pillar", "vase", "arch", "bush", "barrel"}),
}
"""Families for places that ``Family.places`` does not know."""
