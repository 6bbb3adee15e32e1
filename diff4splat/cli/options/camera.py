"""``--camera``: build a camera path from presets or from a path file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.settings import PathFrame

PRESET_FRAMES, DEFAULT_FPS = 49, 24.0
FILE_SUFFIXES = (".txt", ".json", ".tum")


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Length, speed and easing of the camera path."""

    frames: int | None = None
    """Number of frames. Default: 49 for presets, all frames of a path file."""
    fps: float | None = None
    """Frames per second. Default: 24 for presets, the times of a path file."""
    amplitude: float | None = None
    """Size of a preset's motion, in near depths or turns. Default: depends on the preset."""
    easing: Literal["linear", "smooth", "ease-in", "ease-out"] = "smooth"
    """Speed profile of a preset."""


def choose_path(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    """The path that ``camera`` names, at the size and with the lens of ``view``.

    Raises:
        InputError: neither a known preset nor a readable path file.
    """
    return _from_file(camera, view, options) if _is_file(camera) else _preset(camera, view, options)


def _preset(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    from diff4splat.paths.build import build_path
    from diff4splat.paths.settings import PathSettings

    settings = PathSettings(
        frames=PRESET_FRAMES if options.frames is None else options.frames,
        fps=DEFAULT_FPS if options.fps is None else options.fps,
        amplitude=options.amplitude,
        easing=options.easing,
    )
    return build_path(camera, view, settings)


def _from_file(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    """The poses and times of the file, resampled if a frame count or rate is given."""
    from diff4splat.io.cameras.path_files import read_path
    from diff4splat.paths.resize import resized
    from diff4splat.paths.spline import resample

    if options.amplitude is not None:
        raise ConfigError("--amplitude: expected with presets only, got a path file; leave it out")
    read = read_path(Path(camera), view.camera, options.fps or DEFAULT_FPS)
    path = resized(read, view.camera.size_px)
    if options.frames is None and options.fps is None:
        return path
    frames = len(path) if options.frames is None else options.frames
    duration_s = float(path.times_s[-1])
    file_fps = (frames - 1) / duration_s if duration_s > 0 and frames > 1 else DEFAULT_FPS
    return resample(path, frames, file_fps if options.fps is None else options.fps)


def _is_file(camera: str) -> bool:
    try:
        return camera.lower().endswith(FILE_SUFFIXES) or "/" in camera or Path(camera).is_file()
    except OSError:
        return False  # longer than any file name: presets, then
