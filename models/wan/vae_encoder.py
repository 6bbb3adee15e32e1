"""Encoder of Wan's autoencoder: a chunk of video to mean and log-variance.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns. Wan 2.1 lists its layers one
after another; Wan 2.2 groups those of a resolution beside a shortcut.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.video_vae.encoder import halves_time
from diff4splat.models.wan.history import History, WanCausalConv3d, WanRmsNorm
from diff4splat.models.wan.vae_layers import WanDownsample, WanMidBlock, WanResidualBlock
from diff4splat.models.wan.vae_shortcuts import average_down


class WanDownBlock(nn.Module):
    """A resolution of Wan 2.2 and the way to the next."""

    def __init__(self, channels: int, out_channels: int, blocks: int, halves: bool | None) -> None:
        super().__init__()
        widths = [channels] + [out_channels] * blocks
        self.resnets = nn.ModuleList(map(WanResidualBlock, widths, widths[1:]))
        self.downsampler = None if halves is None else WanDownsample(out_channels, halves)
        self.factor = (2 if halves else 1, 1 if halves is None else 2)
        self.out_channels = out_channels

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Residual blocks and downsampling beside averages."""
        hidden = frames
        for block in self.resnets:
            hidden = block(hidden, history)
        if self.downsampler is not None:
            hidden = self.downsampler(hidden, history)
        return hidden + average_down(frames, self.out_channels, self.factor)


class WanEncoder(nn.Module):
    """Pixels in [−1, 1], folded by the pixel patch, to 2 c channels."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths = config.widths
        self.conv_in = WanCausalConv3d(3 * config.pixel_patch**2, widths[0])
        make = _levels if config.layout == "wan2.1" else _grouped_levels
        self.down_blocks = nn.ModuleList(make(config))
        self.mid_block = WanMidBlock(widths[-1])
        self.norm_out = WanRmsNorm(widths[-1], 3)
        self.conv_out = WanCausalConv3d(widths[-1], 2 * config.latent_channels)

    def forward(
        self, video: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """One chunk: frame 0 alone, or any number of packs of four frames."""
        features = self.conv_in(video, history)
        for block in self.down_blocks:
            features = block(features, history)
        features = self.mid_block(features, history)
        return self.conv_out(torch.nn.functional.silu(self.norm_out(features)), history)


def _levels(config: VaeConfig) -> list[nn.Module]:
    layers: list[nn.Module] = []
    for level, (before, width) in enumerate(_pairs(config.widths)):
        widths = [before] + [width] * config.blocks
        layers += map(WanResidualBlock, widths, widths[1:])
        if level < len(config.widths) - 1:
            layers.append(WanDownsample(width, halves_time(level + 1, len(config.widths))))
    return layers


def _grouped_levels(config: VaeConfig) -> list[nn.Module]:
    last = len(config.widths) - 1
    halves = [
        halves_time(level + 1, last + 1) if level < last else None for level in range(last + 1)
    ]
    pairs = _pairs(config.widths)
    return [
        WanDownBlock(*pair, config.blocks, half) for pair, half in zip(pairs, halves, strict=True)
    ]


def _pairs(widths: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip((widths[0], *widths[:-1]), widths, strict=True))
