"""What a camera path is built for: the first camera, the depths that scale it, and the timing."""

import math
from dataclasses import dataclass

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.easing import Easing, require_easing
from diff4splat.paths.limits import require_amplitude, require_frames


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
