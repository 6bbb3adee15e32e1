"""Static cameras around the scene, as in a capture studio.

The first camera looks along +z and is the input view. The others are on an arc in two rows. The
last two are at positions between the others, for evaluation on held-out views.
"""

import numpy as np

from diff4splat.data_prep.synthetic.cameras import LensSpec, ViewSpec
from diff4splat.data_prep.synthetic.layout.kinds import SceneKind
from diff4splat.data_prep.synthetic.rng import Rng

HALF_ARC_DEG = 55.0
ROW_GAP_RAD = 0.22
"""Additional tilt of the upper row."""
HELD_OUT_POSITIONS = ((-0.28, 0.5), (0.41, 0.35))
"""(share of the half arc, share of the row gap) of the last two cameras."""


def rig_views(
    kind: SceneKind, lens: LensSpec, area_radius_m: float, views: int, rng: Rng
) -> list[ViewSpec]:
    """``views`` static cameras, at least four, so that two remain for training."""
    half = np.tan(np.radians(lens.fov_deg) / 2)
    distance = float(area_radius_m * rng.uniform(0.72, 0.8) / half) + 0.25 * area_radius_m
    tilt = float(np.radians(rng.uniform(*kind.tilt_deg)))
    positions = [(0.0, 0.0), *_arc(views - 1 - len(HELD_OUT_POSITIONS)), *HELD_OUT_POSITIONS]
    return [
        ViewSpec(
            azimuth_rad=float(np.radians(HALF_ARC_DEG)) * side,
            tilt_rad=tilt + ROW_GAP_RAD * row,
            distance_m=distance,
            path="static",
        )
        for side, row in positions
    ]


def _arc(count: int) -> list[tuple[float, float]]:
    """Positions along the arc, alternating between the lower and the upper row."""
    sides = np.linspace(-1.0, 1.0, count)
    return [(float(side), float(number % 2)) for number, side in enumerate(sides)]
