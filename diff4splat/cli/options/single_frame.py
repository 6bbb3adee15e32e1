"""``--frame``: one frame of a camera path."""

from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.physical_path import PhysicalPath


def select_frame(path: "CameraPath", frame: int) -> "CameraPath":
    """The path that holds only the pose and time of ``frame``; -1 is the last.

    Raises:
        ConfigError: the path has no such frame.
    """
    if not -len(path) <= frame < len(path):
        raise ConfigError(f"--frame: expected -{len(path)} to {len(path) - 1}, got {frame}")
    index = slice(frame % len(path), frame % len(path) + 1)
    return replace(path, cameras=path.cameras[index], times_s=path.times_s[index])


def select_physical_frame(physical_path: "PhysicalPath", frame: int) -> "PhysicalPath":
    """The same of a physical camera, which keeps its motion during the frame.

    Raises:
        ConfigError: the path has no such frame.
    """
    return replace(physical_path, path=select_frame(physical_path.path, frame))
