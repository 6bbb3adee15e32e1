"""What a camera path is built for: the first camera, the depths that scale it, and the timing."""

import math
from dataclasses import dataclass

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.easing import Easing, require_easing

MAX_POSES = 100_000
"""More cameras than this are a mistake, not a film."""

MAX_AMPLITUDE = 100.0
"""Near depths or turns; beyond it sines lose their digits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFrame:
    """The view that a path starts from. Its pose is ignored: a path begins at the identity."""

    camera: Camera
    """One camera (no batch); gives intrinsics, image size and dtype."""
    near_depth: float
    """z of the nearest content, in scene units; amplitudes are shares of it."""
    focus_depth: float
    """z of what the camera turns around, straight ahead; at least ``near_depth``."""

    def __post_init__(self) -> None:
        if self.camera.batch_shape != ():
            raise ShapeError(
                f"PathFrame.camera: expected one camera, got {self.camera.batch_shape}"
            )
        if not (math.isfinite(self.focus_depth) and 0 < self.near_depth <= self.focus_depth):
            raise InputError(
                "camera path: expected 0 < near depth <= focus depth < infinity, got near depth "
                f"{self.near_depth:g} and focus depth {self.focus_depth:g}; check the depth map"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSettings:
    """Timing and strength of a path."""

    frames: int
    fps: float
    amplitude: float | None = None
    """For segments that name none; None leaves each preset its own default."""
    easing: Easing = "smooth"

    def __post_init__(self) -> None:
        require_frames(self.frames, self.fps)
        require_easing(self.easing)
        if self.amplitude is not None:
            require_amplitude(self.amplitude, "amplitude")


def require_frames(frames: int, fps: float) -> None:
    """Refuse frame counts and rates that no film has.

    Raises:
        InputError: no frame, too many, or a rate that is not a finite number above 0.
    """
    if not 1 <= frames <= MAX_POSES:
        raise InputError(f"frames: expected 1 to {MAX_POSES}, got {frames}; choose another count")
    if not (math.isfinite(fps) and fps > 0):
        raise InputError(f"fps: expected a finite rate above 0, got {fps:g}; choose another rate")


def require_amplitude(amplitude: float, what: str) -> None:
    """Refuse amplitudes that are not finite or absurdly large.

    Raises:
        InputError: with the allowed range.
    """
    if not abs(amplitude) <= MAX_AMPLITUDE:
        raise InputError(
            f"{what}: expected an amplitude from -{MAX_AMPLITUDE:g} to {MAX_AMPLITUDE:g}, "
            f"got {amplitude:g}; choose a smaller one"
        )
