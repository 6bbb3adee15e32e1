"""A contact sheet of clips: the first and the last input frame of each, side by side.

Axes: ``h w`` pixels of one frame.
"""

from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.io.photos.images import write_png
from diff4splat.io.pixels import unit_rgb

COLUMNS, GAP_PX = 8, 4
MOST_CLIPS = 64


def write_clip_sheet(folder: Path, file: Path) -> None:
    """Up to ``MOST_CLIPS`` clips, spread evenly over the folder; nothing of an empty one."""
    clips = ClipFolder(folder)
    if not len(clips):
        return
    part = ClipPart(views=(0,), flow=False, instances=False, tracks=False)
    write_png(clip_sheet([clips.clip(place, part) for place in clips.spread(MOST_CLIPS)]), file)


def clip_sheet(clips: list[Clip]) -> Float[Tensor, "height width 3"]:
    """Rows of eight clips on white, each in the corner of a tile that holds the largest."""
    tiles = [_first_and_last(clip) for clip in clips]
    height, width = (max(tile.shape[axis] for tile in tiles) for axis in (0, 1))
    tiles = [_padded(tile, height, width) for tile in tiles]
    blank = torch.ones_like(tiles[0])
    columns = min(COLUMNS, len(tiles))
    tiles += [blank] * (-len(tiles) % columns)
    rows = [torch.cat(tiles[at : at + columns], 1) for at in range(0, len(tiles), columns)]
    return torch.cat(rows)


def _first_and_last(clip: Clip) -> Float[Tensor, "h w 3"]:
    rgb = clip.views[0].rgb
    both = unit_rgb(torch.cat([rgb[0], rgb[-1]], 1))
    return _padded(both, both.shape[0] + GAP_PX, both.shape[1] + GAP_PX)


def _padded(
    tile: Float[Tensor, "h w 3"], height: int, width: int
) -> Float[Tensor, "height width 3"]:
    right, below = width - tile.shape[1], height - tile.shape[0]
    return torch.nn.functional.pad(tile, (0, 0, 0, right, 0, below), value=1.0)
