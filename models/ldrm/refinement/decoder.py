"""Features of every cell of the key frames: tokens, frames and a cost volume in one U-Net.

Axes: ``b`` batch, ``f`` frames, ``k`` key frames, ``n`` = b k, ``e`` width of a token, ``h w``
cells of 4 pixels, ``h4 w4`` cells of 16 (the tokens' grid).

    frames ─ cells ─┬─ match ─ cost volume ─┐
                    └───────────────────────┴─ 1/4 ── 1/8 ── 1/16 ─┐
    tokens ─ linear ────────────────────────────────────────────── + ─ 1/16 ── 1/8 ── 1/4 ─ out

With a depth prior, a linear layer of the distances at which key frames start is added to the first
features; fresh, it adds nothing.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX, ConvBlock, cells
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.ldrm.refinement.cost_volume import cost_volume
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance

CELL_CHANNELS = 3 * CELL_PX**2
START_MAPS = 3
"""The prior's distance, how parallax changes it, and the confidence of that."""
GROWTH = (3, 5, 7)
"""Widths of the three resolutions, in thirds of the configured one."""


class RefinementDecoder(nn.Module):
    """Fused features of the key frames at a quarter of the resolution."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        refinement = config.refinement
        self.config = refinement
        fine, middle, coarse = widths(refinement.channels)
        if refinement.cost_volume_depths:
            self.match = nn.Sequential(
                nn.Conv2d(CELL_CHANNELS, fine, 3, padding=1),
                nn.SiLU(),
                nn.Conv2d(fine, refinement.match_channels, 3, padding=1),
            )
        self.input_conv = nn.Conv2d(
            CELL_CHANNELS + 2 * refinement.cost_volume_depths, fine, 3, padding=1
        )
        if refinement.depth_prior:
            channels = START_MAPS * CELL_PX**2
            self.input_start = zero_(nn.Conv2d(channels, fine, 3, padding=1, bias=False))
        self.fine, self.middle, self.coarse = ConvBlock(fine), ConvBlock(middle), ConvBlock(coarse)
        self.down_1 = nn.Conv2d(fine, middle, 2, stride=2)
        self.down_2 = nn.Conv2d(middle, coarse, 2, stride=2)
        self.tokens = nn.Conv2d(config.ldrm.width, coarse, 1)
        self.mid = ConvBlock(coarse)
        self.up_2 = nn.Conv2d(coarse, 4 * middle, 1)
        self.up_1 = nn.Conv2d(middle, 4 * fine, 1)
        self.middle_out, self.fine_out = ConvBlock(middle), ConvBlock(fine)

    def forward(
        self, tokens: Float[Tensor, "b e k h4 w4"], posed_video: PosedVideo
    ) -> Float[Tensor, "n c h w"]:
        """Features of all key frames in order."""
        pixels = cells(posed_video.key_rgb.flatten(0, 1)) * 2 - 1
        features = self.input_conv(torch.cat([pixels, *self._cost_volume(posed_video)], 1))
        if self.config.depth_prior:
            features = features + self.input_start(_start_cells(posed_video.start_or_plane()))
        fine = self.fine(features)
        middle = self.middle(self.down_1(fine))
        coarse = self.coarse(self.down_2(middle))
        coarse = self.mid(coarse + self.tokens(tokens.transpose(1, 2).flatten(0, 1)))
        middle = self.middle_out(middle + _upsample(self.up_2(coarse)))
        return self.fine_out(fine + _upsample(self.up_1(middle)))

    def _cost_volume(self, posed_video: PosedVideo) -> list[Tensor]:
        """Nothing where no depths are compared."""
        if not self.config.cost_volume_depths:
            return []
        video = posed_video.rgb.transpose(1, 2)
        matched = self.match(cells(video.flatten(0, 1)) * 2 - 1).unflatten(0, video.shape[:2])
        height, width = posed_video.cameras.size_px
        cameras = posed_video.cameras.resized((height // CELL_PX, width // CELL_PX))
        return [cost_volume(matched, cameras, self._inverse_depths(matched.device)).flatten(0, 1)]

    def _inverse_depths(self, device: torch.device) -> Float[Tensor, " d"]:
        nearest, farthest = self.config.depth_range
        return torch.linspace(1 / farthest, 1 / nearest, self.config.cost_volume_depths).to(device)


def _start_cells(start: StartDistance) -> Float[Tensor, "n c h w"]:
    maps = torch.stack([start.prior, start.parallax - start.prior, start.confidence], 2)
    return cells(maps.flatten(0, 1))


def widths(width: int) -> tuple[int, ...]:
    """Channels at 1/4, 1/8 and 1/16 of the resolution."""
    return tuple(width * share // GROWTH[0] for share in GROWTH)


def _upsample(maps: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
    return torch.nn.functional.pixel_shuffle(maps, 2)
