"""Scenes from files of other programs: checkpoints that move, and Gaussians of one moment."""

import math
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import InputError
from diff4splat.geometry.camera import focal_from_fov, pinhole
from diff4splat.io.checkpoints.fourdgs_checkpoint import read_fourdgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_checkpoint import read_native_4dgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_import import from_raw_4d
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime_conversion import to_spacetime
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

CHECKPOINT_SUFFIXES = (".pth", ".pt")
FOURDGS_TIME_RANGE_S, NATIVE_TIME_RANGE_S = (0.0, 1.0), (-0.5, 0.5)
"""Default time ranges of the two programs."""
MOMENT_TIME_RANGE_S = (0.0, 1.0)
"""How long the default path of a file of one moment lasts."""
FPS, SIZE_PX, FOV_DEG = 24, (360, 640), 60.0
"""Frame rate, image size and horizontal field of view of the default camera path."""
_RADIUS_QUANTILE, _DISTANCE_IN_RADII = 0.9, 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedScene:
    """A scene, and notes on what the import could not keep."""

    scene: Scene
    notes: tuple[str, ...] = ()


def is_checkpoint(source: Path) -> bool:
    """Whether ``source`` is a folder of 4DGaussians or a torch file."""
    return source.is_dir() or source.suffix.lower() in CHECKPOINT_SUFFIXES


def import_scene(source: Path, time_range_s: tuple[float, float] | None = None) -> ImportedScene:
    """Load a scene file, a checkpoint that moves, or a PLY, SPZ or GLB file of one moment.

    ``time_range_s`` is the time range of a checkpoint in seconds; None is the program's default.

    Raises:
        FileFormatError: the input is missing, damaged, or of another format.
        InputError: the time range is impossible, or given for a scene file.
    """
    if not is_checkpoint(source):
        if time_range_s is not None:
            raise InputError("time range: expected with a checkpoint only, got a scene file")
        if source.suffix.lower() in SPLAT_FORMATS:
            return _import_moment(source)
        return ImportedScene(scene=load_scene(source))
    if time_range_s is not None:
        _require_time_range(time_range_s)
    if source.is_dir():
        return _import_fourdgs(source, time_range_s or FOURDGS_TIME_RANGE_S)
    return _import_native(source, time_range_s or NATIVE_TIME_RANGE_S)


def default_path(means: Float[Tensor, "n 3"], time_range_s: tuple[float, float]) -> CameraPath:
    """A static camera outside the scene that looks along the z axis at the centre.

    Checkpoints have no camera path. The path covers ``time_range_s`` at ``FPS`` frames per second.
    """
    start_s, stop_s = time_range_s
    frames = max(2, round((stop_s - start_s) * FPS) + 1)
    pose = torch.eye(4).repeat(frames, 1, 1)
    pose[:, :3, 3] = _camera_position(means.float())
    camera = pinhole(focal_from_fov(FOV_DEG, SIZE_PX[1]), SIZE_PX)
    times_s = torch.linspace(start_s, stop_s, frames)
    return CameraPath(cameras=camera.with_pose(pose), times_s=times_s)


def _camera_position(means: Float[Tensor, "n 3"]) -> Float[Tensor, " 3"]:
    """Three radii before the median of ``means``; a radius holds nine tenths of them."""
    if len(means) == 0:
        return torch.zeros(3)
    center = means.median(0).values
    distances = (means - center).norm(dim=-1).sort().values
    radius = float(distances[int(_RADIUS_QUANTILE * (len(distances) - 1))]) or 1.0
    return center - torch.tensor([0.0, 0.0, _DISTANCE_IN_RADII * radius])


def _import_moment(file: Path) -> ImportedScene:
    gaussians = SPLAT_FORMATS[file.suffix.lower()].read(file)
    kind = file.suffix.lower().removeprefix(".").upper()
    motion = StaticMotion(time_range_s=MOMENT_TIME_RANGE_S)
    return ImportedScene(scene=_scene(gaussians, motion, f"{kind} file"))


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
