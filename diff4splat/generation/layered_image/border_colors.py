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


def continue_colors(
    rgb: Float[Tensor, "h w 3"], margin: int, static: Bool[Tensor, "h w"] | None = None
) -> Float[Tensor, "hs ws 3"]:
    """The image with ``margin`` cells around it; inside it stays as it is.

    Only ``static`` cells of the border are continued, or all where none is.
    """
    height, width = rgb.shape[:2]
    size = (height + 2 * margin, width + 2 * margin)
    inside = torch.zeros(size, dtype=torch.bool, device=rgb.device)
    inside[margin : margin + height, margin : margin + width] = True
    edge = _edge(height, width).to(rgb.device)
    if static is not None and bool((edge & static).any()):
        edge &= static
    border, outside = edge.nonzero() + margin, (~inside).nonzero()
    weights = torch.cdist(outside.to(rgb), border.to(rgb)) ** -DECAY
    colors = rgb.new_empty(*inside.shape, 3)
    colors[inside] = rgb.flatten(0, 1)
    colors[~inside] = (weights @ rgb[edge]) / weights.sum(1, keepdim=True)
    return colors


def _edge(height: int, width: int) -> Bool[Tensor, "h w"]:
    """The outermost cells."""
    edge = torch.ones(height, width, dtype=torch.bool)
    edge[1:-1, 1:-1] = False
    return edge
