"""Features of every cell of the key frames: tokens, pictures and parallax in one U-Net.

Axes: ``b`` batch, ``f`` frames, ``k`` key frames, ``n`` = b k, ``e`` width of a token, ``h w``
cells of 4 pixels, ``h4 w4`` cells of 16 (the tokens' grid).

    pictures ─ cells ─┬─ match ─ plane sweep ─┐
                      └───────────────────────┴─ 1/4 ── 1/8 ── 1/16 ─┐
    tokens ─ linear ──────────────────────────────────────────────── + ─ 1/16 ── 1/8 ── 1/4 ─ out
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX, ConvBlock, cells
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.ldrm.refinement.cost_volume import cost_volume
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo

CELL_CHANNELS = 3 * CELL_PX**2
GROWTH = (3, 5, 7)
"""Widths of the three resolutions, in thirds of the configured one."""


class RefinementDecoder(nn.Module):
    """Fused features of the key frames at a quarter of the resolution."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        own = config.detail
        self.config = own
        fine, middle, coarse = widths(own.width)
        if own.depths:
            self.match = nn.Sequential(
                nn.Conv2d(CELL_CHANNELS, fine, 3, padding=1),
                nn.SiLU(),
                nn.Conv2d(fine, own.match_channels, 3, padding=1),
            )
        self.enter = nn.Conv2d(CELL_CHANNELS + 2 * own.depths, fine, 3, padding=1)
        self.fine, self.middle, self.coarse = ConvBlock(fine), ConvBlock(middle), ConvBlock(coarse)
        self.shrink_1 = nn.Conv2d(fine, middle, 2, stride=2)
        self.shrink_2 = nn.Conv2d(middle, coarse, 2, stride=2)
        self.tokens = nn.Conv2d(config.ldrm.width, coarse, 1)
        self.mixed = ConvBlock(coarse)
        self.grow_2 = nn.Conv2d(coarse, 4 * middle, 1)
        self.grow_1 = nn.Conv2d(middle, 4 * fine, 1)
        self.middle_out, self.fine_out = ConvBlock(middle), ConvBlock(fine)

    def forward(
        self, tokens: Float[Tensor, "b e k h4 w4"], sight: PosedVideo
    ) -> Float[Tensor, "n c h w"]:
        """Features of all key frames in order."""
        pixels = cells(sight.key_rgb.flatten(0, 1)) * 2 - 1
        fine = self.fine(self.enter(torch.cat([pixels, *self._agreement(sight)], 1)))
        middle = self.middle(self.shrink_1(fine))
        coarse = self.coarse(self.shrink_2(middle))
        coarse = self.mixed(coarse + self.tokens(tokens.transpose(1, 2).flatten(0, 1)))
        middle = self.middle_out(middle + _twice(self.grow_2(coarse)))
        return self.fine_out(fine + _twice(self.grow_1(middle)))

    def _agreement(self, sight: PosedVideo) -> list[Tensor]:
        """Nothing where no depths are compared."""
        if not self.config.depths:
            return []
        video = sight.rgb.transpose(1, 2)
        matched = self.match(cells(video.flatten(0, 1)) * 2 - 1).unflatten(0, video.shape[:2])
        height, width = sight.cameras.size_px
        cameras = sight.cameras.resized((height // CELL_PX, width // CELL_PX))
        return [cost_volume(matched, cameras, self._inverse_depths(matched.device)).flatten(0, 1)]

    def _inverse_depths(self, device: torch.device) -> Float[Tensor, " d"]:
        nearest, farthest = self.config.range
        return torch.linspace(1 / farthest, 1 / nearest, self.config.depths).to(device)


def widths(width: int) -> tuple[int, ...]:
    """Channels at 1/4, 1/8 and 1/16 of the resolution."""
    return tuple(width * share // GROWTH[0] for share in GROWTH)


def _twice(maps: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
    return torch.nn.functional.pixel_shuffle(maps, 2)
