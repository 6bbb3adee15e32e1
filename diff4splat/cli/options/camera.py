"""``--camera``: build a camera path from presets or from a path file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from diff4splat.cli.options.constraints import InputPath, Number
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.preset_path import PresetPath
    from diff4splat.paths.settings import PathFrame

PRESET_FRAMES, DEFAULT_FPS = 49, 24.0
FILE_SUFFIXES = (".txt", ".json", ".tum")


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Length, speed and easing of the camera path."""

    frames: Annotated[int | None, Number(least=1, most=100_000)] = None
    """Number of frames. Default: 49 for presets, all frames of a path file."""
    fps: Annotated[float | None, Number(above=0)] = None
    """Frames per second. Default: 24 for presets, the times of a path file."""
    amplitude: Annotated[float | None, Number(least=-100, most=100)] = None
    """Size of a preset's motion, in near depths or turns. Default: depends on the preset."""
    easing: Literal["linear", "smooth", "ease-in", "ease-out"] = "smooth"
    """Speed profile of a preset."""


def require_camera(camera: str, options: CameraOptions) -> None:
    """Check preset names and amplitudes, or that the path file is there.

    Raises:
        InputError, ConfigError: a camera path that cannot be used.
    """
    from diff4splat.paths.language import parse_path, require_short_of_near

    if not _is_file(camera):
        require_short_of_near(parse_path(camera, options.amplitude))
        return
    InputPath(what="a camera path file", folder=False).check("--camera", Path(camera))
    if options.amplitude is not None:
        raise ConfigError("--amplitude: expected with presets only, got a path file; leave it out")


def require_no_preset_options(options: CameraOptions) -> None:
    """Check that nothing is asked of a scene's own path that only presets have.

    Raises:
        ConfigError: an amplitude or an easing.
    """
    if options.amplitude is not None or options.easing != CameraOptions().easing:
        raise ConfigError("--amplitude, --easing: expected with presets; name one with --camera")


def choose_path(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    """The path that ``camera`` names, at the size and with the lens of ``view``.

    Raises:
        InputError: neither a known preset nor a readable path file.
    """
    preset = read_preset(camera, options)
    return _from_file(camera, view, options) if preset is None else preset.sized_to(view)


def read_preset(camera: str, options: CameraOptions) -> "PresetPath | None":
    """The presets that ``camera`` names, with their timing; None for a path file."""
    from diff4splat.paths.preset_path import PresetPath
    from diff4splat.paths.settings import PathSettings

    if _is_file(camera):
        return None
    settings = PathSettings(
        frames=PRESET_FRAMES if options.frames is None else options.frames,
        fps=DEFAULT_FPS if options.fps is None else options.fps,
        amplitude=options.amplitude,
        easing=options.easing,
    )
    return PresetPath(text=camera, settings=settings)


def _from_file(camera: str, view: "PathFrame", options: CameraOptions) -> "CameraPath":
    """The poses and times of the file, resampled if a frame count or rate is given."""
    from diff4splat.io.cameras.path_files import read_path
    from diff4splat.paths.resize import resized

    read = read_path(Path(camera), view.camera, options.fps or DEFAULT_FPS)
    return _resampled(resized(read, view.camera.size_px), options)


def scene_path(path: "CameraPath", options: CameraOptions) -> "CameraPath":
    """The path of a scene file with the frame count and rate of ``options``."""
    return _resampled(path, options)


def _resampled(path: "CameraPath", options: CameraOptions) -> "CameraPath":
    from diff4splat.paths.spline import resample

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
