"""Which pixels move, up to the edges that the picture has there: a U-Net beside the branch (ours).

Axes: ``b`` batch, ``hh ww`` pixels, ``hc wc`` cells of 4 pixels, ``c`` the branch's channels. The
branch knows from the words which thing is meant, and sees cells; here pixels are seen, and where a
thing ends.

    picture, place ─ cells of 2 ─ 1/2 ─────────── 1/2 ─ conv (zero) ─ logits
    the branch's features ─ linear ─── + 1/4 ── 1/4 ┘
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.monocular_depth.network import FOLDED_PX, pixel_coordinates


class MaskRefiner(nn.Module):
    """Logits to be added to those of the branch; zero when fresh."""

    def __init__(self, width: int, channels: int) -> None:
        super().__init__()
        self.input_image = nn.Conv2d((3 + 2) * FOLDED_PX**2, width, 3, padding=1)
        self.fine, self.fine_out = ConvBlock(width), ConvBlock(width)
        self.down = nn.Conv2d(width, 2 * width, 2, stride=2)
        self.input_features = nn.Conv2d(channels, 2 * width, 1)
        self.coarse = nn.Sequential(ConvBlock(2 * width), ConvBlock(2 * width))
        self.up = nn.Conv2d(2 * width, 4 * width, 1)
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))

    def forward(
        self, picture: Float[Tensor, "b 3 hh ww"], told: Float[Tensor, "b c hc wc"]
    ) -> Float[Tensor, "b hh ww"]:
        """``picture`` is RGB in [0, 1], its sides multiples of 4."""
        seen = torch.cat([picture * 2 - 1, pixel_coordinates(picture)], 1)
        fine = self.fine(self.input_image(torch.nn.functional.pixel_unshuffle(seen, FOLDED_PX)))
        coarse = self.coarse(self.down(fine) + self.input_features(told))
        larger = torch.nn.functional.pixel_shuffle(self.up(coarse), 2)
        logits = self.head(self.fine_out(fine + larger))
        return torch.nn.functional.pixel_shuffle(logits, FOLDED_PX)[:, 0]
