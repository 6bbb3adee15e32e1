"""Colours beyond the border of an image: the border's own, mixed with distance (ours).

Axes: ``h w`` cells of the image, ``hs ws`` cells with a margin on every side. A cell at distances d
from the border's cells takes their mean with weights d^-5: beside the border nearly the nearest
colour, farther out the mean of a longer piece of it. What lies beyond is uncertain, and the mean of
what may lie there has the least squared error.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

DECAY = 5
"""Less takes over far colours, more leaves streaks (docs/log/appearance-and-depth.md)."""
CHUNK = 1024
"""Cells at a time: all at once would take 300 MB for a photograph."""


def continue_colors(rgb: Float[Tensor, "h w 3"], margin: int) -> Float[Tensor, "hs ws 3"]:
    """The image with ``margin`` cells around it; inside it stays as it is."""
    height, width = rgb.shape[:2]
    size = (height + 2 * margin, width + 2 * margin)
    inside = torch.zeros(size, dtype=torch.bool, device=rgb.device)
    inside[margin : margin + height, margin : margin + width] = True
    edge = _edge(height, width).to(rgb.device)
    border, outside = edge.nonzero() + margin, (~inside).nonzero()
    chunks = outside.to(rgb).split(CHUNK)
    colors = rgb.new_empty(*inside.shape, 3)
    colors[inside] = rgb.flatten(0, 1)
    colors[~inside] = torch.cat([_mixed(chunk, border.to(rgb), rgb[edge]) for chunk in chunks])
    return colors


def _mixed(
    cells: Float[Tensor, "n 2"], border: Float[Tensor, "m 2"], rgb: Float[Tensor, "m 3"]
) -> Float[Tensor, "n 3"]:
    """Colours of ``cells`` from those of the ``border``."""
    squared = sum((at[:, None] - to).square_() for at, to in zip(cells.mT, border.mT, strict=True))
    weights = squared.square().mul_(squared.sqrt_()).reciprocal_()  # d^-5: half the time of pow
    return (weights @ rgb) / weights.sum(1, keepdim=True)


def _edge(height: int, width: int) -> Bool[Tensor, "h w"]:
    """The outermost cells."""
    edge = torch.ones(height, width, dtype=torch.bool)
    edge[1:-1, 1:-1] = False
    return edge
