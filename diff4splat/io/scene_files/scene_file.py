"""The scene file: one versioned ``.safetensors`` with Gaussians, motion, path and provenance.

Axes: ``n`` Gaussians, ``k`` harmonics, ``t`` frames of the path. Every tensor is listed in
docs/reference/scene-format.md. Only what moves is stored with keys; equal scenes give equal bytes.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path

from torch import Tensor

from diff4splat.errors import FileFormatError, InputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.io.require_file import require_file
from diff4splat.io.scene_files.coding.coded_tensors import decode_tensors, encode_tensor
from diff4splat.io.scene_files.coding.plans import plan_tensors
from diff4splat.io.scene_files.compression import TOLERANCES, Compression
from diff4splat.io.scene_files.motion_tensors import StoredMotion, pack_motion, unpack_motion
from diff4splat.io.scene_files.scene_metadata import SceneMetadata, decode, encode
from diff4splat.io.scene_files.tensor_checks import take_floats
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene


def save_scene(scene: Scene, file: Path | str, compression: Compression = "lossless") -> None:
    """Write ``scene`` whole or not at all.

    ``lossless`` keeps every bit of float32 and float64. The others round every number to within
    their tolerances; a scene that they cannot hold is kept without loss.

    Raises:
        InputError: a tensor is not finite or half precision, or the motion is of an unknown kind.
        OutputError: the folder cannot be made or written.
    """
    motion = pack_motion(scene.motion)
    size_px = (int(scene.path.cameras.size_px[0]), int(scene.path.cameras.size_px[1]))
    metadata = SceneMetadata(
        motion=motion.settings,
        size_px=size_px,
        provenance=scene.provenance,
        dilation_px2=scene.dilation_px2,
    )
    tensors = {**_gaussian_tensors(scene.gaussians), **_path_tensors(scene.path), **motion.tensors}
    try:
        _assemble(tensors, metadata)  # what cannot be read back is not written
    except (FileFormatError, ShapeError, InputError) as error:
        raise InputError(f"{file}: the scene cannot be saved: {error}") from error
    if compression != "lossless":
        tensors, metadata = _coded(scene, tensors, metadata, compression)
    write_tensors(TensorFile(tensors=tensors, metadata=encode(metadata)), Path(file))


def load_scene(file: Path | str) -> Scene:
    """Read a scene file of this or an earlier version.

    Raises:
        FileFormatError: missing, damaged, cut off, from a newer version, or of another kind.
    """
    file = Path(file)
    require_file(file, "a scene file (.safetensors)")
    try:
        metadata = decode(read_metadata(file))
        return _assemble(_plain(read_tensors(file), metadata), metadata)
    except (FileFormatError, ShapeError, InputError) as error:
        raise FileFormatError(f"{file}: {error}") from error


def _coded(
    scene: Scene, tensors: dict[str, Tensor], metadata: SceneMetadata, compression: Compression
) -> tuple[dict[str, Tensor], SceneMetadata]:
    """Coded tensors and their metadata; the same as given if that cannot be read back."""
    tolerances, stored, entries = TOLERANCES[compression], dict(tensors), {}
    for name, plan in plan_tensors(scene, tolerances).items():
        coded = encode_tensor(tensors[name], plan)
        if coded is not None:
            parts, entries[name] = coded
            del stored[name]
            stored |= {f"{name}.{part}": value for part, value in parts.items()}
    settings = {"name": compression, **asdict(tolerances)}
    coded_metadata = replace(metadata, encodings=entries, compression=settings)
    try:
        _assemble(_plain(stored, coded_metadata), coded_metadata)
    except (FileFormatError, ShapeError, InputError):
        return tensors, metadata
    return stored, coded_metadata


def _plain(stored: Mapping[str, Tensor], metadata: SceneMetadata) -> Mapping[str, Tensor]:
    if not metadata.encodings:
        return stored
    return decode_tensors(stored, metadata.encodings, sum(t.nbytes for t in stored.values()))


def _gaussian_tensors(gaussians: Gaussians) -> dict[str, Tensor]:
    return {field.name: getattr(gaussians, field.name) for field in fields(gaussians)}


def _path_tensors(path: CameraPath) -> dict[str, Tensor]:
    return {
        "path_focal_px": path.cameras.focal_px,
        "path_center_px": path.cameras.center_px,
        "path_world_from_camera": path.cameras.world_from_camera,
        "path_times_s": path.times_s,
    }


def _assemble(tensors: Mapping[str, Tensor], metadata: SceneMetadata) -> Scene:
    gaussians = _read_gaussians(tensors)
    motion = StoredMotion(settings=metadata.motion, tensors=tensors)
    return Scene(
        gaussians=gaussians,
        motion=unpack_motion(motion, len(gaussians)),
        path=_read_path(tensors, metadata.size_px),
        provenance=metadata.provenance,
        dilation_px2=metadata.dilation_px2,
    )


def _read_gaussians(tensors: Mapping[str, Tensor]) -> Gaussians:
    opacities = take_floats(tensors, "opacities", (None,))
    count = len(opacities)
    gaussians = Gaussians(
        means=take_floats(tensors, "means", (count, 3)),
        quats=take_floats(tensors, "quats", (count, 4)),
        scales=take_floats(tensors, "scales", (count, 3)),
        opacities=opacities,
        sh=take_floats(tensors, "sh", (count, None, 3)),
    )
    _require_activated(gaussians)
    return gaussians


def _require_activated(gaussians: Gaussians) -> None:
    """Logits and logarithms in a scene file would render as something else without a word."""
    if bool(((gaussians.opacities < 0) | (gaussians.opacities > 1)).any()):
        raise FileFormatError("opacities: expected probabilities in [0, 1], got values outside")
    if bool((gaussians.scales < 0).any()):
        raise FileFormatError(
            "scales: expected standard deviations of at least 0, got negative ones"
        )
    kinds = {str(getattr(gaussians, field.name).dtype) for field in fields(gaussians)}
    if len(kinds) != 1:
        raise FileFormatError(f"Gaussians: expected one dtype, got {', '.join(sorted(kinds))}")


def _read_path(tensors: Mapping[str, Tensor], size_px: tuple[int, int]) -> CameraPath:
    times_s = take_floats(tensors, "path_times_s", (None,))
    count = len(times_s)
    cameras = Camera(
        focal_px=take_floats(tensors, "path_focal_px", (count, 2)),
        center_px=take_floats(tensors, "path_center_px", (count, 2)),
        world_from_camera=take_floats(tensors, "path_world_from_camera", (count, 4, 4)),
        size_px=size_px,
    )
    return require_valid_path(CameraPath(cameras=cameras, times_s=times_s), "path")
