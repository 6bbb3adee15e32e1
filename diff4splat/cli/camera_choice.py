"""``--camera``: a preset expression or a path file becomes a camera path of the asked length."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.settings import PathFrame

PRESET_FRAMES = 49
FILE_SUFFIXES = (".txt", ".json", ".tum")


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Length and manner of a camera move, shared by every command that takes one."""

    frames: int | None = None
    """Frames of the video (default: 49 for a preset, as many as it holds for a path file)."""
    fps: float = 24.0
    """Frames per second."""
    amplitude: float | None = None
    """Size of the move as a share of near depth (default: the preset's own)."""
    easing: Literal["linear", "smooth", "ease-in", "ease-out"] = "smooth"
    """How a preset starts and stops."""


def choose_path(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    """The path that ``camera`` names, at the size and with the lens of ``view``.

    Raises:
        InputError: neither a known preset nor a readable path file.
    """
    if not _is_file(camera):
        from diff4splat.paths.build import build_path
        from diff4splat.paths.settings import PathSettings

        frames = PRESET_FRAMES if options.frames is None else options.frames
        settings = PathSettings(
            frames=frames, fps=options.fps, amplitude=options.amplitude, easing=options.easing
        )
        return build_path(camera, view, settings)
    from diff4splat.io.path_files import read_path
    from diff4splat.paths.picture_size import resized
    from diff4splat.paths.spline import resample

    path = resized(read_path(Path(camera), view.camera, options.fps), view.camera.size_px)
    return path if options.frames is None else resample(path, options.frames, options.fps)


def _is_file(camera: str) -> bool:
    return camera.lower().endswith(FILE_SUFFIXES) or "/" in camera or Path(camera).is_file()
