"""Large frames in overlapping tiles, as diffusers cuts and blends them.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns. Memory then depends on the
tile, not on the frame. Norms take statistics per tile, so the result is not that of whole frames.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

OVERLAP = (1 / 6, 1 / 5)
"""Share of a tile's height and width that the next one covers again."""

Frames = Float[Tensor, "b c t h w"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tiles:
    """Height and width of tiles on the way in and on the way out."""

    size: tuple[int, int]
    out_size: tuple[int, int]

    def needed(self, frames: Frames) -> bool:
        """Whether the frames are larger than one tile."""
        return any(side > most for side, most in zip(frames.shape[3:], self.size, strict=True))

    def run(
        self, code: Callable[[Tensor], Tensor], frames: Frames
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """``code`` of every tile, blended with those above and to the left."""
        steps = [int(side * (1 - share)) for side, share in zip(self.size, OVERLAP, strict=True)]
        blends = [int(side * share) for side, share in zip(self.out_size, OVERLAP, strict=True)]
        above: list[Tensor] = []
        bands = []
        for top in range(0, frames.shape[3], steps[0]):
            band = frames[:, :, :, top : top + self.size[0]]
            row = [
                code(band[..., left : left + self.size[1]])
                for left in range(0, frames.shape[4], steps[1])
            ]
            _blend_row(row, above, blends)
            kept = [side - blend for side, blend in zip(self.out_size, blends, strict=True)]
            bands.append(torch.cat([tile[:, :, :, : kept[0], : kept[1]] for tile in row], 4))
            above = row
        return torch.cat(bands, 3)


def _blend_row(row: list[Tensor], above: list[Tensor], blends: list[int]) -> None:
    """In place, from left to right: tiles that are blended already blend into the next."""
    for column, tile in enumerate(row):
        if above:
            _blend(above[column], tile, 3, blends[0])
        if column:
            _blend(row[column - 1], tile, 4, blends[1])


def _blend(before: Tensor, tile: Tensor, axis: int, extent: int) -> None:
    """Lead over from the end of ``before`` to the beginning of ``tile``."""
    extent = min(before.shape[axis], tile.shape[axis], extent)
    if not extent:
        return
    shape = [1] * 5
    shape[axis] = extent
    share = (torch.arange(extent, device=tile.device) / extent).to(tile.dtype).view(shape)
    end = before.narrow(axis, before.shape[axis] - extent, extent)
    begin = tile.narrow(axis, 0, extent)
    begin.copy_(end * (1 - share) + begin * share)
