"""What a reader must know beside the text of a file."""

from dataclasses import dataclass

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.limits import require_frames

DEFAULT_FPS = 24.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSource:
    """Name of the file for messages, and what stands in for everything the file leaves out."""

    name: str
    view: Camera
    """One camera: intrinsics and image size for files that have none."""
    fps: float = DEFAULT_FPS
    """Frame rate for files without times."""

    def __post_init__(self) -> None:
        if self.view.batch_shape != ():
            raise ShapeError(f"PathSource.view: expected one camera, got {self.view.batch_shape}")
        require_frames(1, self.fps)
