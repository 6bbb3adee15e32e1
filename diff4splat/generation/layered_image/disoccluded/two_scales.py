"""What a network inpaints alike at two scales; else what it inpaints at the coarser one (ours).

    image, what is known ─┬─ network ────────────────────────────┐
                          └─ copy of 256 px ─ network ───────────┴─ mean by how far they agree

Axes: ``h w`` pixels. In a large hole the network paints objects of its own: legs that an object
leaves behind become another man. In the copy the hole is half as wide, and the ground goes on.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.inpainting import Inpaint, on_copy
from diff4splat.generation.layered_image.windows import means_around

COARSE_PX, LEAST_SIDE_PX = 256, 384
"""Longer side of the copy, and of images that have a second scale: that of smaller ones would be
nearly the same, or show too little."""
WINDOW_SHARE = 1 / 24
"""Of the longer side: how far the square reaches over whose mean colours both are compared."""
COLOR_SIGMA = 0.1
"""Difference of mean colours at which the finer scale has a weight of 0.6."""


def agreeing_scales(inpaint: Inpaint) -> Inpaint:
    """``inpaint`` where its mean colours are those of the same on a smaller copy."""

    def inpaint_twice(
        rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
    ) -> Float[Tensor, "h w 3"]:
        fine = inpaint(rgb, known)
        if bool(known.all()) or max(known.shape) < LEAST_SIDE_PX:
            return fine
        coarse = on_copy(inpaint, COARSE_PX)(rgb, known)
        mixed = torch.lerp(coarse, fine, _agreement(fine, coarse))
        return torch.where(known[..., None], rgb, mixed)

    return inpaint_twice


def _agreement(
    fine: Float[Tensor, "h w 3"], coarse: Float[Tensor, "h w 3"]
) -> Float[Tensor, "h w 1"]:
    """1 where both have the same mean colours, 0 where these are far apart."""
    squared = means_around(fine - coarse, WINDOW_SHARE).square().sum(-1, keepdim=True)
    return torch.exp(-squared / (2 * COLOR_SIGMA**2))
