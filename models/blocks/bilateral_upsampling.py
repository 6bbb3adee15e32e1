"""Weights with which cells contribute to pixels: near cells of similar colour count most.

Axes: ``h w`` cells, ``s`` pixels per cell side, ``k`` = 9, the pixel's cell and its neighbours.
Joint bilateral upsampling (Kopf et al. 2007):

    weight = exp(−distance² / 2 DISTANCE_SIGMA² − |colour − cell colour|² / 2 COLOR_SIGMA²)
"""

import torch
from jaxtyping import Float
from torch import Tensor

DISTANCE_SIGMA, COLOR_SIGMA = 0.7, 0.1
"""Standard deviations: in cells, and in colour."""
WINDOW = 3
"""Cells per side of a neighbourhood."""


def neighbourhood(maps: Float[Tensor, "c h w"], side: int) -> Float[Tensor, "c k sh sw"]:
    """The 3×3 cells centred on the cell of every pixel; the border is replicated."""
    padded = torch.nn.functional.pad(maps[None], (1, 1, 1, 1), mode="replicate")
    patches = torch.nn.functional.unfold(padded, WINDOW)
    patches = patches.view(maps.shape[0], WINDOW**2, *maps.shape[1:])
    return patches.repeat_interleave(side, -1).repeat_interleave(side, -2)


def log_weights(
    cells: Float[Tensor, "h w 3"], pixels: Float[Tensor, "sh sw 3"]
) -> Float[Tensor, "k sh sw"]:
    """Logarithm of the weight of each neighbouring cell; ``cells`` and ``pixels`` are RGB."""
    side = pixels.shape[0] // cells.shape[0]
    colors = neighbourhood(cells.movedim(-1, 0), side)
    color_distance = (colors - pixels.movedim(-1, 0)[:, None]).square().sum(0)
    return _log_spatial_weight(side, cells) - color_distance / (2 * COLOR_SIGMA**2)


def _log_spatial_weight(side: int, cells: Float[Tensor, "h w 3"]) -> Float[Tensor, "k sh sw"]:
    offset = (torch.arange(side).to(cells) + 0.5) / side - 0.5
    distance = (torch.arange(-1, 2).to(cells)[:, None] - offset).square()
    square = (distance[:, None, :, None] + distance[None, :, None, :]).flatten(0, 1)
    return -square.repeat(1, *cells.shape[:2]) / (2 * DISTANCE_SIGMA**2)
