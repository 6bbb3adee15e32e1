"""Cameras that look at objects from any side, rolled, near and far.

A surface has no up: half of its views are rolled by any angle, so that it may be floor, wall or
ceiling.
"""

import math

import numpy as np

from diff4splat.data_prep.synthetic.arrangements.backdrops import Backdrop
from diff4splat.data_prep.synthetic.arrangements.objects import Arranged
from diff4splat.data_prep.synthetic.cameras import ViewSpec
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import PERSON

FOV_DEG = (28.0, 85.0)
DISTANCES_M, PORTRAIT_RADII = (0.5, 3.2), (1.3, 3.2)
MAX_TILT_DEG, OPEN_TILT_DEG = 85.0, 35.0
FACED_SHARE, FACED_RADII = 0.7, (0.4, 1.3)
"""Of the views of a person, those that a photographer would choose: level, of the upper half."""
FACED_TILT_DEG, FACED_ROLL_DEG = (-15.0, 20.0), 6.0
MAX_ROLL_DEG = 30.0
LEAST_EYE_M = 0.12
ATTEMPTS = 40


def any_view(
    objects: list[Arranged], backdrop: Backdrop, rng: Rng, *, is_portrait: bool
) -> ViewSpec | None:
    """A view from a free place; None where none was found."""
    for attempt in range(ATTEMPTS):
        view = _candidate(objects, backdrop, rng.child("view", attempt), is_portrait)
        if _is_free(eye_of(view), objects, backdrop):
            return view
    return None


def _candidate(
    objects: list[Arranged], backdrop: Backdrop, rng: Rng, is_portrait: bool
) -> ViewSpec:
    target = rng.choice(objects)
    if target.placed.family == PERSON and rng.child("faced").bernoulli(FACED_SHARE):
        return _faced(target, rng.child("face"))
    fov_deg = rng.uniform(*FOV_DEG)
    jitter = 0.6 * target.radius_m if is_portrait else 0.8
    focus = target.center_m + jitter * rng.uniform_array(-1.0, 1.0, 3)
    focus[1] = min(float(focus[1]), 0.0)
    if is_portrait:
        reach = target.radius_m / math.tan(math.radians(fov_deg) / 2)
        distance = reach * rng.uniform(*PORTRAIT_RADII) / 2
    else:
        distance = rng.log_uniform(*DISTANCES_M)
    steepest = OPEN_TILT_DEG if backdrop.is_open else MAX_TILT_DEG
    return ViewSpec(
        azimuth_rad=rng.uniform(-np.pi, np.pi),
        tilt_rad=math.radians(rng.uniform(-10.0, steepest)),
        distance_m=distance,
        path="static",
        focus_m=(float(focus[0]), float(focus[1]), float(focus[2])),
        roll_rad=_roll_rad(backdrop, rng),
        fov_deg=fov_deg,
    )


def _faced(person: Arranged, rng: Rng) -> ViewSpec:
    """From the face down to the waist or the feet."""
    fov_deg = rng.uniform(*FOV_DEG)
    reach = person.radius_m / math.tan(math.radians(fov_deg) / 2)
    aside, up = 0.25 * rng.uniform_array(-1.0, 1.0, 2), rng.uniform(0.0, 0.6)
    focus = person.center_m + person.radius_m * np.array([aside[0], -up, aside[1]])
    return ViewSpec(
        azimuth_rad=rng.uniform(-np.pi, np.pi),
        tilt_rad=math.radians(rng.uniform(*FACED_TILT_DEG)),
        distance_m=max(reach * rng.uniform(*FACED_RADII), 1.1 * person.radius_m),
        path="static",
        focus_m=(float(focus[0]), float(focus[1]), float(focus[2])),
        roll_rad=math.radians(rng.uniform(-FACED_ROLL_DEG, FACED_ROLL_DEG)),
        fov_deg=fov_deg,
    )


def _roll_rad(backdrop: Backdrop, rng: Rng) -> float:
    if rng.bernoulli(0.5):
        return 0.0
    most_deg = MAX_ROLL_DEG if backdrop.is_open else 180.0
    return math.radians(rng.uniform(-most_deg, most_deg))


def eye_of(view: ViewSpec) -> np.ndarray:
    """Where the camera of a view is, in metres."""
    level = view.distance_m * math.cos(view.tilt_rad)
    offset = np.array(
        [
            level * math.sin(view.azimuth_rad),
            -view.distance_m * math.sin(view.tilt_rad),
            -level * math.cos(view.azimuth_rad),
        ]
    )
    return np.array(view.focus_m) + offset


def _is_free(eye: np.ndarray, objects: list[Arranged], backdrop: Backdrop) -> bool:
    inside = all(
        abs(eye[axis]) < 0.93 * half for axis, half in zip((0, 2), backdrop.half_m, strict=True)
    )
    above = LEAST_EYE_M < -eye[1] < 0.95 * backdrop.height_m
    clear = all(float(np.linalg.norm(eye - item.center_m)) > item.radius_m for item in objects)
    return bool((inside or backdrop.is_open) and above and clear)
