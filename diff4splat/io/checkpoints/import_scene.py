"""Scenes from files of other programs: chosen by what a file or folder holds."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from diff4splat import __version__
from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.checkpoints.fourdgs_checkpoint import read_fourdgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_checkpoint import read_native_4dgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_import import from_raw_4d
from diff4splat.io.imports.camera_path import default_path, static_path
from diff4splat.io.imports.ply_sequence import numbered_files, read_ply_sequence
from diff4splat.io.imports.point_maps import read_point_maps
from diff4splat.io.ply.ply_file import read_spacetime_ply
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.flip_book import flip_book
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime_conversion import to_spacetime
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

CHECKPOINT_SUFFIXES = (".pth", ".pt")
POINT_MAP_SUFFIX, SCENE_NAME = ".npz", "scene.safetensors"
FOURDGS_TIME_RANGE_S, NATIVE_TIME_RANGE_S = (0.0, 1.0), (-0.5, 0.5)
"""Default time ranges of the two programs."""
MOMENT_TIME_RANGE_S = (0.0, 1.0)
"""How long the default path of a file of one moment lasts."""
FPS = 24.0
"""Of numbered files and point maps that name no times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedScene:
    """A scene, and notes on what the import could not keep."""

    scene: Scene
    notes: tuple[str, ...] = ()


def is_checkpoint(source: Path) -> bool:
    """Whether ``source`` is a folder of 4DGaussians or a torch file."""
    if source.is_dir():
        return not (source / SCENE_NAME).is_file() and len(numbered_files(source)) < 2
    return source.suffix.lower() in CHECKPOINT_SUFFIXES


def import_scene(
    source: Path,
    time_range_s: tuple[float, float] | None = None,
    fps: float = FPS,
    advance: Callable[[], None] = lambda: None,
) -> ImportedScene:
    """Load a scene file, a checkpoint, Gaussians of one moment or several, or point maps.

    ``time_range_s`` is the time range of a checkpoint in seconds; None is the program's default.
    ``fps`` gives times to files that name none. ``advance`` is called after each numbered file.

    Raises:
        FileFormatError: the input is missing, damaged, or of another format.
        InputError: the time range is impossible, or given for a scene file.
        MissingExtraError: the format needs a package that is not installed.
    """
    if is_checkpoint(source):
        return _import_checkpoint(source, time_range_s)
    if time_range_s is not None:
        raise InputError("time range: expected with a checkpoint only, got a scene file")
    if source.is_dir():
        if (source / SCENE_NAME).is_file():
            return ImportedScene(scene=load_scene(source / SCENE_NAME))
        gaussians, motion, note = read_ply_sequence(numbered_files(source), fps, advance)
        return ImportedScene(scene=_scene(gaussians, motion, "PLY sequence"), notes=(note,))
    suffix = source.suffix.lower()
    if suffix == POINT_MAP_SUFFIX:
        return _import_point_maps(source, fps)
    if suffix in SPLAT_FORMATS:
        return _import_moment(source)
    return ImportedScene(scene=load_scene(source))


def _import_checkpoint(source: Path, time_range_s: tuple[float, float] | None) -> ImportedScene:
    if time_range_s is not None:
        _require_time_range(time_range_s)
    if source.is_dir():
        return _import_fourdgs(source, time_range_s or FOURDGS_TIME_RANGE_S)
    return _import_native(source, time_range_s or NATIVE_TIME_RANGE_S)


def _import_moment(file: Path) -> ImportedScene:
    suffix = file.suffix.lower()
    if suffix == ".ply" and (moving := read_spacetime_ply(file)) is not None:
        scene = _scene(moving.gaussians, moving.motion, "Spacetime Gaussians")
        return ImportedScene(scene=scene, notes=moving.notes)
    content = SPLAT_FORMATS[suffix].read(file)
    if not len(content.gaussians):
        raise FileFormatError(f"{file}: expected at least one Gaussian, got none; export it again")
    motion = StaticMotion(time_range_s=MOMENT_TIME_RANGE_S)
    scene = _scene(content.gaussians, motion, f"{suffix.removeprefix('.').upper()} file")
    if content.camera is None:
        return ImportedScene(scene=scene, notes=content.notes)
    path = static_path(content.camera, MOMENT_TIME_RANGE_S)
    return ImportedScene(scene=replace(scene, path=path), notes=content.notes)


def _import_point_maps(file: Path, fps: float) -> ImportedScene:
    frames, times_s = read_point_maps(file, fps)
    if len(frames) == 1:
        motion: Motion = StaticMotion(time_range_s=MOMENT_TIME_RANGE_S)
        return ImportedScene(scene=_scene(frames[0], motion, "point map"))
    gaussians, motion = flip_book(frames, times_s)
    note = f"{len(frames)} point maps are kept one by one: nothing is known of their motion"
    return ImportedScene(scene=_scene(gaussians, motion, "point maps"), notes=(note,))


def _import_fourdgs(folder: Path, time_range_s: tuple[float, float]) -> ImportedScene:
    start_s, stop_s = time_range_s
    if start_s != 0:
        raise InputError(f"time range: expected a start of 0 for 4DGaussians, got {start_s:g}")
    gaussians, motion = read_fourdgs_checkpoint(folder, duration_s=stop_s)
    return ImportedScene(scene=_scene(gaussians, motion, "4DGaussians"))


def _import_native(file: Path, time_range_s: tuple[float, float]) -> ImportedScene:
    checkpoint = read_native_4dgs_checkpoint(file)
    start_s, stop_s = time_range_s
    gaussians, motion = to_spacetime(
        from_raw_4d(checkpoint.raw), time_range_s=time_range_s, period_s=stop_s - start_s
    )
    notes = ("not imported: the environment map",) if checkpoint.has_environment_map else ()
    return ImportedScene(scene=_scene(gaussians, motion, "native 4D Gaussians"), notes=notes)


def _scene(gaussians: Gaussians, motion: Motion, program: str) -> Scene:
    generator = f"{program}, imported by diff4splat {__version__}"
    return Scene(
        gaussians=gaussians,
        motion=motion,
        path=default_path(gaussians.means, motion.time_range_s),
        provenance=Provenance(generator=generator),
    )


def _require_time_range(time_range_s: tuple[float, float]) -> None:
    start_s, stop_s = time_range_s
    if not (math.isfinite(start_s) and math.isfinite(stop_s) and start_s < stop_s):
        raise InputError(
            f"time range: expected finite seconds START < STOP, got {start_s:g} and {stop_s:g}"
        )
