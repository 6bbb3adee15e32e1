"""Colours beyond the border of a photograph: its own, reflected at the border (ours, ADR 48).

Axes: ``h w`` cells of the image, ``hs ws`` cells with a margin on every side. The mean of what may
lie there has the least squared error, but looks like a blurred frame; a reflection continues the
texture and meets the border without a step. Farther out it fades to that mean: there it would show
a second copy of what is in the middle of the image.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.border.extension import cells_outside
from diff4splat.generation.layered_image.border.mixed_colors import continue_colors

FADE = (0.25, 0.5)
"""Where the reflection starts to fade and where it has gone, over the longer side."""


def reflect_colors(rgb: Float[Tensor, "h w 3"], margin: int) -> Float[Tensor, "hs ws 3"]:
    """The image with ``margin`` cells around it; inside it stays as it is."""
    rows, columns = (_reflected(side, margin, rgb.device) for side in rgb.shape[:2])
    reflected, share = rgb[rows][:, columns], _faded(rgb, margin)
    if not bool(share.any()):
        return reflected
    return torch.lerp(reflected, continue_colors(rgb, margin), share[..., None])


def _reflected(side: int, margin: int, device: torch.device) -> Int[Tensor, " s"]:
    """The cell of the image that each cell shows; the outermost twice, since it shines inward."""
    cells = torch.arange(-margin, side + margin, device=device).remainder(2 * side)
    return torch.minimum(cells, 2 * side - 1 - cells)


def _faded(rgb: Float[Tensor, "h w 3"], margin: int) -> Float[Tensor, "hs ws"]:
    """Share of the mean: 0 beside the border, 1 far out."""
    height, width = rgb.shape[:2]
    outside = (cells_outside(side, margin, rgb.device).to(rgb) for side in (height, width))
    down, across = outside
    start, end = FADE
    distance = torch.hypot(down[:, None], across) / max(height, width)
    share = ((distance - start) / (end - start)).clamp(0, 1)
    return share.square() * (3 - 2 * share)
