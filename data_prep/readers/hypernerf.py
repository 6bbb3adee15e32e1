"""Nerfies and HyperNeRF: pictures with a camera file each, and JSON that says which is what.

``metadata.json`` gives each picture a camera and a ``warp_id`` that counts times; ``points.npy``
has points in the world of the cameras' files (https://github.com/google/nerfies#datasets).
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.holding_out import hold_out
from diff4splat.data_prep.readers.json_file import read_object
from diff4splat.data_prep.readers.nerfies_camera import NerfiesCamera, read_nerfies_camera
from diff4splat.data_prep.readers.nerfies_folder import (
    PictureFolder,
    World,
    choose_pictures,
    read_roles,
    read_world,
)
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.picture_file import PictureFile
from diff4splat.data_prep.readers.places import Place, inside, picture_at
from diff4splat.data_prep.readers.points import Found, cloud_from, read_positions
from diff4splat.data_prep.readers.rig import fps_note
from diff4splat.data_prep.readers.shots import Draft, Shot
from diff4splat.errors import FileFormatError
from diff4splat.geometry import rigid
from diff4splat.paths.formats.checks import exact_poses
from diff4splat.paths.formats.json_fields import optional_number

LOOKS_LIKE = "dataset.json, metadata.json and camera/*.json (Nerfies, HyperNeRF)"
DEFAULT_FPS = 15.0


def matches(folder: Path) -> bool:
    """Whether ``folder`` looks like it."""
    names = ("dataset.json", "metadata.json")
    return (folder / "camera").is_dir() and all((folder / name).is_file() for name in names)


def read(place: Place, options: ReadOptions) -> Draft:
    """What the files say.

    Raises:
        FileFormatError: naming the file and picture.
        ConfigError: cameras are to be held out that are not there.
    """
    folder, chosen = place.folder, options.hold_out is not None
    roles, reason = read_roles(folder / "dataset.json", take_all=chosen)
    world, pictures = read_world(folder), choose_pictures(folder / "rgb", options.downscale)
    taken = _shots(folder, list(roles), world, pictures, options.fps or DEFAULT_FPS)
    shots = [replace(one, held_out=held) for one, held in zip(taken, roles.values(), strict=True)]
    if chosen:
        shots, reason = hold_out(shots, options.hold_out, place.name)
    points, cloud_notes = _points(folder / "points.npy", world)
    return Draft(
        name=place.name,
        source="Nerfies or HyperNeRF",
        shots=shots,
        split_reason=reason,
        shrink=pictures.shrink,
        points=points,
        background=options.background,
        notes=(*pictures.notes, *fps_note(options.fps, DEFAULT_FPS), *cloud_notes),
    )


def _shots(
    folder: Path, names: list[str], world: World, pictures: PictureFolder, fps: float
) -> list[Shot]:
    file = folder / "metadata.json"
    metadata = read_object(file)
    records = [_record(metadata, name, file) for name in names]
    files = [inside(folder / "camera", f"{name}.json", str(file)) for name in names]
    cameras = [read_nerfies_camera(camera) for camera in files]
    poses = _poses(cameras, files, world)
    numbers = _dense([_whole(record, "camera_id", where) for record, where in records])
    return [
        Shot(
            picture=PictureFile(file=picture_at(pictures.folder, f"{name}.png", str(file))),
            lens=camera.lens.coarser(pictures.size),
            world_from_camera=pose,
            time_s=_whole(record, "warp_id", where) / fps,
            camera=number,
        )
        for name, camera, pose, (record, where), number in zip(
            names, cameras, poses, records, numbers, strict=True
        )
    ]


def _poses(cameras: list[NerfiesCamera], files: list[Path], world: World) -> Float[Tensor, "n 4 4"]:
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
    """The number under ``key``; a picture without ``camera_id`` is of camera 0."""
    value = optional_number(record, key, where)
    if value is None and key == "warp_id":
        raise FileFormatError(
            f"{where}: expected 'warp_id', which counts times, got none; add it to every picture"
        )
    return int(value or 0)


def _dense(cameras: list[int]) -> list[int]:
    order = {camera: number for number, camera in enumerate(sorted(set(cameras)))}
    return [order[camera] for camera in cameras]


def _points(file: Path, world: World) -> Found:
    if not file.is_file():
        return None, ()
    positions = world.carried(torch.from_numpy(read_positions(file)))
    return cloud_from(positions.numpy(), None, file.name)
