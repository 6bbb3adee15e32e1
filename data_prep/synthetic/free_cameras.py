"""Static cameras of all kinds: from above, from close by, rolled, with short and long lenses.

Worlds whose cameras are all level teach a network that depth follows from the image row. Here only
the first camera, the input view, is of that kind.
"""

import math
from dataclasses import replace

import numpy as np

from diff4splat.data_prep.synthetic.cameras import LensSpec, ViewSpec, sample_views
from diff4splat.data_prep.synthetic.layout.kinds import SceneKind
from diff4splat.data_prep.synthetic.rng import Rng

FOV_DEG = (28.0, 85.0)
DISTANCE_SHARE = (0.22, 1.25)
"""Distance to the focus in shares of that of the input view, evenly by its logarithm."""
MAX_TILT_DEG = 82.0
"""Half of the tilts are in the lowest quarter: from straight above there is little to see."""
LEAST_EYE_SHARE = 0.15
"""Height of the lowest eye above ground, in radii of the area."""
FOCUS_SHARE = 0.7
"""Reach of the focus points around the centre, in radii of the area."""
INDOOR_AZIMUTH_DEG = 70.0
"""Rooms have no wall behind the input view."""
ROLLED_SHARE, MAX_ROLL_DEG = 0.5, 30.0


def free_views(
    kind: SceneKind, lens: LensSpec, area_radius_m: float, views: int, rng: Rng
) -> list[ViewSpec]:
    """The input view, then ``views`` − 1 cameras that have nothing in common but the world."""
    first = replace(sample_views(kind, lens, area_radius_m, 1, rng)[0], path="static")
    others = [
        _free_view(kind, first.distance_m, area_radius_m, rng.child("free", number))
        for number in range(views - 1)
    ]
    return [first, *others]


def _free_view(kind: SceneKind, distance_m: float, area_radius_m: float, rng: Rng) -> ViewSpec:
    is_walled = kind.is_indoors or "street" in kind.tags
    azimuth_deg = INDOOR_AZIMUTH_DEG if is_walled else 180.0
    distance_m *= rng.log_uniform(*DISTANCE_SHARE)
    focus_m = FOCUS_SHARE * area_radius_m * rng.uniform_array(-1.0, 1.0, 3)
    focus_m[1] = -abs(float(focus_m[1]))
    eye_m = LEAST_EYE_SHARE * area_radius_m + float(focus_m[1])
    least = math.asin(min(max(eye_m / distance_m, -0.6), 0.9))
    roll_deg = MAX_ROLL_DEG * rng.uniform(-1.0, 1.0) if rng.bernoulli(ROLLED_SHARE) else 0.0
    return ViewSpec(
        azimuth_rad=float(np.radians(rng.uniform(-azimuth_deg, azimuth_deg))),
        tilt_rad=least + max(math.radians(MAX_TILT_DEG) - least, 0.0) * rng.uniform(0.0, 1.0) ** 2,
        distance_m=distance_m,
        path="static",
        focus_m=(float(focus_m[0]), float(focus_m[1]), float(focus_m[2])),
        roll_rad=float(np.radians(roll_deg)),
        fov_deg=rng.uniform(*FOV_DEG),
    )
