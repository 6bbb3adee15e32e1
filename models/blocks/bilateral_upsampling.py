"""What pixels take over from coarser cells: near ones of their own colour count most.

Axes: ``h w`` cells, ``s`` pixels per cell side, ``k`` = 9 cells around a pixel's own. This is joint
bilateral upsampling (Kopf et al. 2007):

    weight = exp(−distance² / 2 NEAR² − |colour − cell colour|² / 2 ALIKE²)
"""

import torch
from jaxtyping import Float
from torch import Tensor

NEAR, ALIKE = 0.7, 0.1
"""Standard deviations: in cells, and in colour."""
AROUND = 3


def neighbourhood(maps: Float[Tensor, "c h w"], side: int) -> Float[Tensor, "c k sh sw"]:
    """The cells around the own cell of every pixel; borders continue outwards."""
    padded = torch.nn.functional.pad(maps[None], (1, 1, 1, 1), mode="replicate")
    patches = torch.nn.functional.unfold(padded, AROUND)
    patches = patches.view(len(maps), AROUND**2, *maps.shape[1:])
    return patches.repeat_interleave(side, -1).repeat_interleave(side, -2)


def log_weights(
    cells: Float[Tensor, "h w 3"], pixels: Float[Tensor, "sh sw 3"]
) -> Float[Tensor, "k sh sw"]:
    """Logarithm of how much each cell around says of a pixel; ``cells`` and ``pixels`` are RGB."""
    side = pixels.shape[0] // cells.shape[0]
    colors = neighbourhood(cells.movedim(-1, 0), side)
    unlike = (colors - pixels.movedim(-1, 0)[:, None]).square().sum(0)
    return _nearness(side, cells) - unlike / (2 * ALIKE**2)


def _nearness(side: int, cells: Float[Tensor, "h w 3"]) -> Float[Tensor, "k sh sw"]:
    inside = (torch.arange(side).to(cells) + 0.5) / side - 0.5
    away = (torch.arange(-1, 2).to(cells)[:, None] - inside).square()
    square = (away[:, None, :, None] + away[None, :, None, :]).flatten(0, 1)
    return -square.repeat(1, *cells.shape[:2]) / (2 * NEAR**2)
