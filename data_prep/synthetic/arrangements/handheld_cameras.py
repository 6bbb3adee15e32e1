"""Cameras as people hold them: nearly level, at the height of a person, near or far."""

import math

import numpy as np

from diff4splat.data_prep.synthetic.arrangements.backdrops import Backdrop
from diff4splat.data_prep.synthetic.arrangements.cameras import eye_of
from diff4splat.data_prep.synthetic.arrangements.furnished import Furniture
from diff4splat.data_prep.synthetic.cameras import ViewSpec
from diff4splat.data_prep.synthetic.rng import Rng

FOV_DEG = (30.0, 80.0)
CLOSE_SHARE, CLOSE_REACH = 0.55, (0.7, 2.5)
"""Distances in those at which the object fills the view."""
DISTANCES_M = (1.2, 5.0)
TILT_DEG, SMALL_TILT_DEG = (-8.0, 28.0), (5.0, 65.0)
"""Small objects are seen from above."""
SMALL_M = 0.3
ROLL_DEG, ROLLED_SHARE = 6.0, 0.4
EYE_M, GAP_M = (0.15, 2.4), 0.06
ATTEMPTS = 40


def handheld_view(objects: list[Furniture], backdrop: Backdrop, rng: Rng) -> ViewSpec | None:
    """A view from a free place; None where none was found."""
    for attempt in range(ATTEMPTS):
        view = _candidate(objects, rng.child("view", attempt))
        if _is_free(eye_of(view), objects, backdrop):
            return view
    return None


def _candidate(objects: list[Furniture], rng: Rng) -> ViewSpec:
    target = rng.choice(objects)
    fov_deg = rng.uniform(*FOV_DEG)
    focus = target.center_m + 0.5 * target.radius_m * rng.uniform_array(-1.0, 1.0, 3)
    if rng.bernoulli(CLOSE_SHARE):
        fills = target.radius_m / math.tan(math.radians(fov_deg) / 2)
        distance = fills * rng.log_uniform(*CLOSE_REACH)
    else:
        distance = rng.log_uniform(*DISTANCES_M)
    tilt = rng.uniform(*(SMALL_TILT_DEG if target.radius_m < SMALL_M else TILT_DEG))
    roll = ROLL_DEG * rng.uniform(-1.0, 1.0) if rng.bernoulli(ROLLED_SHARE) else 0.0
    return ViewSpec(
        azimuth_rad=rng.uniform(-np.pi, np.pi),
        tilt_rad=math.radians(tilt),
        distance_m=distance,
        path="static",
        focus_m=(float(focus[0]), min(float(focus[1]), 0.0), float(focus[2])),
        roll_rad=math.radians(roll),
        fov_deg=fov_deg,
    )


def _is_free(eye: np.ndarray, objects: list[Furniture], backdrop: Backdrop) -> bool:
    inside = backdrop.is_open or all(
        abs(eye[axis]) < 0.95 * half for axis, half in zip((0, 2), backdrop.half_m, strict=True)
    )
    level = EYE_M[0] < -eye[1] < min(EYE_M[1], 0.95 * backdrop.height_m)
    clear = not any(
        ((eye > one.low_m - GAP_M) & (eye < one.high_m + GAP_M)).all() for one in objects
    )
    return bool(inside and level and clear)
