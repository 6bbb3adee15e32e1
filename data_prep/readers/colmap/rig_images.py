"""Several static cameras in folders ``cam01``, ``cam02`` and so on, posed by one COLMAP model.

An image of the model belongs to the camera whose folder is in its name (``cam01/frame_00001.jpg``),
whose name it has (``cam01.png``), or whose number it ends with (``image1.jpg``).
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.camera_rig.rig import rig_from_folders, rig_shots
from diff4splat.data_prep.readers.colmap.model import Model, ModelImage
from diff4splat.data_prep.readers.colmap.read_model import camera_intrinsics, image_poses
from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.data_prep.readers.files.file_discovery import last_number
from diff4splat.errors import FileFormatError

_STANDS = 1e-4
"""How far entries of one camera's poses may be apart; positions in shares of the rig's extent."""


def read_rig(
    model: Model, folders: Mapping[str, Path], fps: float
) -> tuple[list[Shot], tuple[str, ...]]:
    """Every image of each camera with a pose in the model, and notes.

    Raises:
        FileFormatError: no camera has one, or one has several that differ.
    """
    images = _images_by_camera(model, folders)
    rig = rig_from_folders({name: folders[name] for name in folders if name in images})
    poses = [image_poses(images[name], model.folder) for name in rig.names]
    standing = torch.stack([pose[0] for pose in poses])
    extent = float((standing[:, :3, 3] - standing[:, :3, 3].mean(0)).norm(dim=-1).max())
    for name, pose in zip(rig.names, poses, strict=True):
        _require_standing(pose, extent, name, model.folder)
    lenses = [
        camera_intrinsics(model.cameras[images[name][0].camera], f"{model.folder}: {name}")
        for name in rig.names
    ]
    without = [name for name in folders if name not in images]
    notes = (f"{', '.join(without)} left out: the model has no pose for it",) if without else ()
    return rig_shots(rig, standing, lenses, fps), (*notes, *rig.notes())


def _images_by_camera(model: Model, folders: Mapping[str, Path]) -> dict[str, list[ModelImage]]:
    found = defaultdict(list)
    for image in model.images:
        name = _camera_of(image.name, folders)
        if name is not None:
            found[name].append(image)
    if not found:
        raise FileFormatError(
            f"{model.folder}: expected images called after the folders {_some(folders)}, got "
            f"{_some(image.name for image in model.images)}; call them cam01/0001.png or cam01.png"
        )
    return found


def _camera_of(image: str, folders: Iterable[str]) -> str | None:
    path = PurePosixPath(image.replace("\\", "/"))
    for name in (*path.parts[:-1], path.stem):
        if name in folders:
            return name
    number = last_number(path.name)
    alike = [name for name in folders if len(path.parts) == 1 and last_number(name) == number]
    return alike[0] if len(alike) == 1 else None


def _require_standing(
    poses: Float[Tensor, "i 4 4"], extent: float, name: str, folder: Path
) -> None:
    turned = float((poses[:, :3, :3] - poses[:1, :3, :3]).abs().max())
    moved = float((poses[:, :3, 3] - poses[:1, :3, 3]).abs().max())
    if turned > _STANDS or moved > _STANDS * max(extent, 1e-12):
        raise FileFormatError(
            f"{folder}: expected one pose of {name}, got {len(poses)} that differ; give COLMAP one "
            "image per camera, or write a transforms.json if the cameras move"
        )


def _some(names: Iterable[str]) -> str:
    listed = list(names)
    more = ", ..." if len(listed) > 3 else ""
    return ", ".join(listed[:3]) + more
