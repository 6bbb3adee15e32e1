"""How far off depth may be: the Laplace scale of the error of log depth, for every pixel.

After Kendall and Gal 2017 (aleatoric uncertainty). Axes: ``b`` batch, ``c`` channels, ``h w`` half
of the image's pixels. It reads features without changing them: depth is the same with and without.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.image_unet.cells import FOLDED_PX

WIDTH = 48
LOG_LIMITS = (-6.0, 2.0)
"""A quarter of a percent, and a factor of 1,600: beyond, the loss would divide by about 0."""


class UncertaintyHead(nn.Module):
    """The logarithm of the scale; 0, a factor of e, when fresh."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, WIDTH, 3, padding=1)
        self.head = zero_(nn.Conv2d(WIDTH, FOLDED_PX**2, 3, padding=1))

    def forward(self, features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 1 h2 w2"]:
        """Of every pixel."""
        cells = self.head(torch.nn.functional.silu(self.conv(features.detach())))
        return torch.nn.functional.pixel_shuffle(cells, FOLDED_PX).clamp(*LOG_LIMITS)
