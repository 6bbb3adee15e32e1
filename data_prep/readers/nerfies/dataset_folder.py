"""Files that all images of a Nerfies or HyperNeRF folder share: world, sizes and split.

``scene.json`` has the centre and scale of the capture, position' = scale · (position − centre);
``rgb/2x`` has images of half the size, and so on; ``dataset.json`` has the split.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.files.json_file import read_object, texts
from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_fields import numbers, optional_number

_EVERY, _AFTER = 4, 2
"""Without val_ids: every fourth image is for training, the second after each is held out."""
_USUAL = (
    "no val_ids in dataset.json: as is usual then, every 4th image is learnt from, the 2nd after "
    "each is held out, and those between are left out"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldTransform:
    """Maps the world of the files to that of the capture."""

    center: Float[Tensor, "3"]
    scale: float

    def carried(self, positions: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Positions in the world of the capture."""
        return (positions - self.center) * self.scale


def read_world_transform(folder: Path) -> WorldTransform:
    """Read ``scene.json``; the identity without one.

    Raises:
        FileFormatError: it is damaged.
    """
    file = folder / "scene.json"
    if not file.is_file():
        return WorldTransform(center=torch.zeros(3, dtype=torch.float64), scale=1.0)
    record, where = read_object(file), str(file)
    scale = optional_number(record, "scale", where)
    if scale is not None and scale <= 0:
        raise FileFormatError(
            f"{where}: 'scale': expected a number above 0, got {scale:g}; repair the file"
        )
    center = torch.tensor(numbers(record, "center", 3, where), dtype=torch.float64)
    return WorldTransform(center=center, scale=1.0 if scale is None else scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageFolder:
    """The image folder in use."""

    folder: Path
    size: int
    """What the full image was divided by: 2 in ``rgb/2x``."""
    shrink: int
    """What is left to do."""
    notes: tuple[str, ...] = ()


def choose_image_folder(folder: Path, downscale: int) -> ImageFolder:
    """The smallest images from which those asked for can be made, else the largest there are.

    Raises:
        FileFormatError: there are none.
    """
    names = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    sizes = [int(name[:-1]) for name in names if name[:-1].isdecimal() and name.endswith("x")]
    if not sizes or min(sizes) < 1:
        raise FileFormatError(
            f"{folder}: expected images in folders 1x, 2x and so on, got none; copy them again"
        )
    size = max((size for size in sizes if downscale % size == 0), default=min(sizes))
    shrink = max(downscale // size, 1)
    note = f"there is nothing to make images at 1/{downscale} from: those of rgb/{size}x are used"
    return ImageFolder(
        folder=folder / f"{size}x",
        size=size,
        shrink=shrink,
        notes=() if size * shrink == downscale else (note,),
    )


def read_split(file: Path, take_all: bool) -> tuple[dict[str, bool], str]:
    """Whether each image is held out, and why, in words; ``take_all`` leaves that open.

    Raises:
        FileFormatError: damaged, or without names.
    """
    record, where = read_object(file), str(file)
    every, learnt, held = (texts(record, key, where) for key in ("ids", "train_ids", "val_ids"))
    every = every or [*learnt, *held]
    if not every:
        raise FileFormatError(f"{where}: expected names under 'ids', got none; repair the file")
    if take_all:
        return dict.fromkeys(every, False), ""
    if held:
        roles = dict.fromkeys(learnt, False) | dict.fromkeys(held, True)
        return roles, "val_ids of dataset.json held out, as given by the data set"
    roles = dict.fromkeys(every[::_EVERY], False) | dict.fromkeys(every[_AFTER::_EVERY], True)
    return {name: roles[name] for name in every if name in roles}, _USUAL
