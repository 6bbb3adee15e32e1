"""Whether a scene can be fitted to a capture at all.

Checked once, before anything is allocated; each refusal says what to do.
"""

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.rigid import require_rigid

ROUNDING = 1e-9
"""Places closer than this share of their coordinates are one place."""
_LARGEST = 1e18
"""Squares of larger numbers are infinite in float32."""


def require_valid_capture(capture: Capture) -> Capture:
    """``capture`` itself.

    Raises:
        ShapeError: cameras, times, indices and images differ in number.
        InputError: no frames, a time that is not finite, a camera that shows two images at one
            time, a pose that is not a rotation and a translation, or images from one place only
            and without depth.
    """
    _require_counts(capture)
    _require_times(capture)
    require_rigid(capture.cameras.world_from_camera, f"{capture.name}: camera poses")
    focal_px = capture.cameras.focal_px
    if not bool((torch.isfinite(focal_px) & (focal_px > 0)).all()):
        raise InputError(f"{capture.name}: expected focal lengths above 0; repair the cameras")
    numbers = (focal_px, capture.cameras.center_px, capture.cameras.position)
    if not all(bool((values.abs() <= _LARGEST).all()) for values in numbers):
        raise InputError(
            f"{capture.name}: expected cameras in numbers up to {_LARGEST:.0e}, as fits need them, "
            "got larger ones; repair the cameras or scale the scene down"
        )
    _require_parallax(capture)
    return capture


def _require_counts(capture: Capture) -> None:
    counts = {
        "cameras": capture.cameras.batch_shape[:1],
        "times_s": tuple(capture.times_s.shape),
        "camera_index": tuple(capture.camera_index.shape),
        "held_out": tuple(capture.held_out.shape),
        "frames": (len(capture.frames),),
    }
    if len(set(counts.values())) != 1:
        got = ", ".join(f"{name} {shape}" for name, shape in counts.items())
        raise ShapeError(f"{capture.name}: expected one entry per frame everywhere, got {got}")
    if len(capture) == 0:
        raise InputError(f"{capture.name}: expected images, got none; check the folder")


def _require_times(capture: Capture) -> None:
    if not bool(torch.isfinite(capture.times_s).all()):
        raise InputError(
            f"{capture.name}: expected a finite time for every frame, got NaN or infinity"
        )
    for camera in capture.camera_index.unique().tolist():
        frames = (capture.camera_index == camera).nonzero().flatten()
        times_s = capture.times_s[frames].sort().values
        if bool((times_s.diff() <= 0).any()):
            at_s = float(times_s[:-1][times_s.diff() <= 0][0])
            raise InputError(
                f"{capture.name}: expected one image per camera and time, got two of camera "
                f"{camera} at {at_s:g} s; give every frame its own time"
            )


def _require_parallax(capture: Capture) -> None:
    """Several places, or depth: otherwise nothing says how far away anything is."""
    learnt = capture.learnt
    position = capture.cameras.position[learnt].double()
    if len(learnt) == 0 or bool(
        (position - position[:1]).abs().max() > ROUNDING * position.abs().max()
    ):
        return
    if capture.frames.read(int(learnt[0])).depth is None:
        raise InputError(
            f"{capture.name}: expected images from at least two places, got one static camera "
            "and no depth; move the camera, add cameras, or give depth"
        )
