"""Nerfies and HyperNeRF: images with one camera file each, and JSON metadata.

``metadata.json`` gives each image a camera and a ``warp_id`` that counts times; ``points.npy``
has points in the world of the cameras' files (https://github.com/google/nerfies#datasets).
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.camera_rig.rig import fps_note
from diff4splat.data_prep.readers.common.test_split import choose_test_split
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.files.file_discovery import (
    CaptureLocation,
    find_image,
    resolve_inside,
)
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.data_prep.readers.files.point_cloud import (
    CloudWithNotes,
    cloud_from_arrays,
    read_positions,
)
from diff4splat.data_prep.readers.nerfies.camera import NerfiesCamera, read_nerfies_camera
from diff4splat.data_prep.readers.nerfies.dataset_folder import (
    ImageFolder,
    WorldTransform,
    choose_image_folder,
    read_split,
    read_world_transform,
)
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import FileFormatError
from diff4splat.geometry import rigid
from diff4splat.paths.formats.checks import exact_poses
from diff4splat.paths.formats.json_fields import optional_number

EXPECTED_FILES = "dataset.json, metadata.json and camera/*.json (Nerfies, HyperNeRF)"
DEFAULT_FPS = 15.0


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    names = ("dataset.json", "metadata.json")
    return (folder / "camera").is_dir() and all((folder / name).is_file() for name in names)


def read(location: CaptureLocation, options: ReadOptions) -> UndecodedCapture:
    """Read the capture.

    Raises:
        FileFormatError: naming the file and image.
        ConfigError: cameras are to be held out that are not there.
    """
    folder, chosen = location.folder, options.hold_out is not None
    roles, reason = read_split(folder / "dataset.json", take_all=chosen)
    world, images = (
        read_world_transform(folder),
        choose_image_folder(folder / "rgb", options.downscale),
    )
    taken = _shots(folder, list(roles), world, images, options.fps or DEFAULT_FPS)
    shots = [replace(one, held_out=held) for one, held in zip(taken, roles.values(), strict=True)]
    if chosen:
        shots, reason = choose_test_split(shots, options.hold_out, location.name)
    points, cloud_notes = _points(folder / "points.npy", world)
    return UndecodedCapture(
        name=location.name,
        source="Nerfies or HyperNeRF",
        shots=shots,
        split_reason=reason,
        shrink=images.shrink,
        points=points,
        background=options.background,
        notes=(*images.notes, *fps_note(options.fps, DEFAULT_FPS), *cloud_notes),
    )


def _shots(
    folder: Path, names: list[str], world: WorldTransform, images: ImageFolder, fps: float
) -> list[Shot]:
    file = folder / "metadata.json"
    metadata = read_object(file)
    records = [_record(metadata, name, file) for name in names]
    files = [resolve_inside(folder / "camera", f"{name}.json", str(file)) for name in names]
    cameras = [read_nerfies_camera(camera) for camera in files]
    poses = _poses(cameras, files, world)
    numbers = _dense([_whole(record, "camera_id", where) for record, where in records])
    return [
        Shot(
            image=ImageFile(file=find_image(images.folder, f"{name}.png", str(file))),
            lens=camera.lens.downscaled(images.size),
            world_from_camera=pose,
            time_s=_whole(record, "warp_id", where) / fps,
            camera=number,
        )
        for name, camera, pose, (record, where), number in zip(
            names, cameras, poses, records, numbers, strict=True
        )
    ]


def _poses(
    cameras: list[NerfiesCamera], files: list[Path], world: WorldTransform
) -> Float[Tensor, "n 4 4"]:
    rotation = torch.tensor([camera.orientation for camera in cameras], dtype=torch.float64).mT
    position = torch.tensor([camera.position for camera in cameras], dtype=torch.float64)
    poses = rigid.from_parts(rotation, world.carried(position))
    return exact_poses(poses, [file.name for file in files], str(files[0].parent))


def _record(metadata: Mapping[str, object], name: str, file: Path) -> tuple[dict[str, object], str]:
    record, where = metadata.get(name), f"{file}: '{name}'"
    if not isinstance(record, dict):
        raise FileFormatError(f"{where}: expected warp_id and camera_id, got none; add them")
    return record, where


def _whole(record: dict[str, object], key: str, where: str) -> int:
    """The number under ``key``; an image without ``camera_id`` is of camera 0."""
    value = optional_number(record, key, where)
    if value is None and key == "warp_id":
        raise FileFormatError(
            f"{where}: expected 'warp_id', which counts times, got none; add it to every image"
        )
    return int(value or 0)


def _dense(cameras: list[int]) -> list[int]:
    order = {camera: number for number, camera in enumerate(sorted(set(cameras)))}
    return [order[camera] for camera in cameras]


def _points(file: Path, world: WorldTransform) -> CloudWithNotes:
    if not file.is_file():
        return None, ()
    positions = world.carried(torch.from_numpy(read_positions(file)))
    return cloud_from_arrays(positions.numpy(), None, file.name)
