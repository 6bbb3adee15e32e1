"""Moving scenes for other programs: OpenUSD, ONNX and scene files, compared before they appear."""

from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path

import torch

from diff4splat.errors import OutputError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.scene_files.compression import Compression
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_onnx.scene_onnx_file import SceneOnnxReader, write_scene_onnx
from diff4splat.io.usd.sample_times import MAX_TIMES, between_s, sample_times_s
from diff4splat.io.usd.usd_file import UsdReader, write_usd
from diff4splat.outputs.compressed_scene import LEAST_PSNR_DB
from diff4splat.outputs.export_check import ExportCheck, check_states, require_floor
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.bake import bake_within
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.polynomial import PolynomialMotion, linearised
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

USD_FLOOR_DB, SCENE_FLOOR_DB, ONNX_FLOOR_DB = 45.0, 60.0, 60.0
ONNX_TOLERANCE = 1e-5
"""Largest difference of a number, or share of it where it is larger than 1."""
CHECKED_TIMES, MOST_HALVINGS = 4, 4
TOLERANCE_PX = 0.1


def export_usd(scene: Scene, file: Path) -> tuple[tuple[ExportCheck, ...], int]:
    """Write a stage with time samples; returns the check and the number of sampled times.

    OpenUSD itself reads it between the samples. Where that is under the floor, as for motions that
    are no lines, the gaps are halved.

    Raises:
        InputError: a value is NaN, infinite or beyond float32.
        MissingExtraError: usd-core is not installed.
        OutputError: the file shows something else than the scene, or cannot be written.
    """
    halvings = 0
    while True:
        times_s = sample_times_s(scene.motion, halvings)
        last = halvings == MOST_HALVINGS or 2 * len(times_s) > MAX_TIMES or len(times_s) == 1
        with suppress(_TooFewSamplesError), atomic_path(file) as temporary:
            write_usd(scene, temporary, times_s)
            checked_s = [*between_s(times_s, CHECKED_TIMES), times_s[-1]]
            state_at = UsdReader(temporary).state_at
            check = check_states(scene, state_at, checked_s, "OpenUSD", USD_FLOOR_DB)
            if check.worst_db < USD_FLOOR_DB and not last:
                raise _TooFewSamplesError  # removes the temporary file
            require_floor([check], file, "convert single moments to .ply instead")
            return (check,), len(times_s)
        halvings += 1


class _TooFewSamplesError(Exception):
    pass


def export_onnx(scene: Scene, file: Path) -> tuple[tuple[ExportCheck, ...], float]:
    """Write a graph; returns the check and the largest difference of a number.

    Raises:
        InputError: another motion than key frames or native 4D Gaussians, or not finite.
        MissingExtraError: onnx is not installed.
        OutputError: ONNX Runtime computes something else, or the file cannot be written.
    """
    with atomic_path(file) as temporary:
        write_scene_onnx(scene, temporary)
        reader = SceneOnnxReader(temporary)
        times_s = checked_times_s(scene)
        error = max(_difference(reader.state_at(t), scene.state_at(t)) for t in times_s)
        if not error <= ONNX_TOLERANCE:
            raise OutputError(
                f"{file}: expected the numbers of the scene within {ONNX_TOLERANCE:g}, got "
                f"{error:.2g} off; report this scene"
            )
        check = check_states(scene, reader.state_at, times_s, "ONNX Runtime", ONNX_FLOOR_DB)
        require_floor([check], file, "report this scene")
    return (check,), error


def export_scene_file(
    scene: Scene, file: Path, compression: Compression = "lossless"
) -> tuple[ExportCheck, ...]:
    """Write a scene file, read it again and compare.

    Raises:
        InputError: a tensor is not finite.
        OutputError: the file shows something else than the scene, or cannot be written.
    """
    with atomic_path(file) as temporary:
        save_scene(scene, temporary, compression)
        state_at = load_scene(temporary).state_at
        times_s = checked_times_s(scene)
        floor_db = SCENE_FLOOR_DB if compression == "lossless" else LEAST_PSNR_DB
        check = check_states(scene, state_at, times_s, "diff4splat", floor_db)
        require_floor([check], file, "write it with --compression lossless")
    return (check,)


def checked_times_s(scene: Scene) -> list[float]:
    """A few times, most of them between key times."""
    times_s = sample_times_s(scene.motion)
    return [*between_s(times_s, CHECKED_TIMES), times_s[-1]]


def storable(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene with a motion that scene files know, and what that changes."""
    if not isinstance(scene.motion, PolynomialMotion):
        return scene, ()
    gaussians, motion, error = linearised(scene.gaussians, scene.motion)
    note = f"curves became lines, at most {error:.3g} scene units off; rotations stay as they are"
    return replace(scene, gaussians=gaussians, motion=motion), (note,)


def keyed(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene with key frames or native 4D Gaussians, and the error of that.

    Raises:
        ConfigError: the motion is too fast for key frames.
    """
    scene, notes = storable(scene)
    known = isinstance(scene.motion, KeyframeMotion | SpacetimeMotion)
    if known or not len(scene.motion.moving_index):
        return scene, notes
    return baked(scene)


def baked(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene with key frames, and the error of that in pixels of its cameras.

    Raises:
        ConfigError: the motion is too fast for key frames.
    """
    cameras = scene.path.cameras[:: max(1, len(scene.path) // 8)]
    motion, error = bake_within(scene.gaussians, scene.motion, cameras, TOLERANCE_PX)
    notes = [f"motion became {len(motion.key_times_s)} key times, {error.largest_px:.2g} px off"]
    if max(error.opacity_lost, error.color_lost) > 0:
        notes.append(
            f"left out: changes of up to {error.opacity_lost:.3g} in opacity and "
            f"{error.color_lost:.3g} in harmonics"
        )
    return replace(scene, motion=motion), tuple(notes)


def _difference(found: Gaussians, wanted: Gaussians) -> float:
    errors = [0.0]
    for field in fields(Gaussians):
        left = getattr(found, field.name).double()
        right = getattr(wanted, field.name).detach().double()
        share = (left - right).abs() / right.abs().clamp_min(1)
        errors.append(float(share.max()) if share.numel() else 0.0)
    return max(errors) if all(torch.isfinite(torch.tensor(errors))) else float("inf")
