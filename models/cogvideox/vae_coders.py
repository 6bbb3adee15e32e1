"""Encoder and decoder of CogVideoX's autoencoder, a chunk at a time.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns. Time is halved at the first
two resolutions of the encoder and doubled at the first two of the decoder.
"""

from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.cogvideox.vae_layers import (
    CogCausalConv3d,
    CogDownsample,
    CogResidualBlock,
    CogUpsample,
    make_norm,
)
from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.wan.history import History

TIME_LEVELS = 2
"""Resolutions that change time."""
MIDDLE_BLOCKS = 2


class CogLevel(nn.Module):
    """Residual blocks of one resolution."""

    def __init__(self, widths: list[int], groups: int, latent_channels: int = 0) -> None:
        super().__init__()
        self.resnets = nn.ModuleList(
            CogResidualBlock(channels, out_channels, groups, latent_channels)
            for channels, out_channels in pairwise(widths)
        )

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History, latent: Tensor | None = None
    ) -> Float[Tensor, "b c2 t h w"]:
        """One after the other."""
        for block in self.resnets:
            frames = block(frames, history, latent)
        return frames


class CogDownLevel(CogLevel):
    """A resolution of the encoder and, but for the last, the way to the next."""

    def __init__(self, widths: list[int], groups: int, in_time: bool | None) -> None:
        super().__init__(widths, groups)
        steps = [] if in_time is None else [CogDownsample(widths[-1], in_time)]
        self.downsamplers = nn.ModuleList(steps)

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History, latent: Tensor | None = None
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Residual blocks, then downsampling."""
        frames = super().forward(frames, history, latent)
        for step in self.downsamplers:
            frames = step(frames, history)
        return frames


class CogUpLevel(CogLevel):
    """A resolution of the decoder and, but for the last, the way to the next finer one."""

    def __init__(
        self, widths: list[int], groups: int, latent_channels: int, in_time: bool | None
    ) -> None:
        super().__init__(widths, groups, latent_channels)
        steps = [] if in_time is None else [CogUpsample(widths[-1], in_time)]
        self.upsamplers = nn.ModuleList(steps)

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History, latent: Tensor | None = None
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Residual blocks, then upsampling."""
        frames = super().forward(frames, history, latent)
        for step in self.upsamplers:
            frames = step(frames, history)
        return frames


class CogEncoder(nn.Module):
    """Pixels in [−1, 1] to mean and log-variance."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths, groups = config.widths, config.groups
        self.conv_in = CogCausalConv3d(3, widths[0])
        pairs = zip((widths[0], *widths), widths, _changes(widths), strict=False)
        self.down_blocks = nn.ModuleList(
            CogDownLevel([before] + [width] * config.blocks, groups, in_time)
            for before, width, in_time in pairs
        )
        self.mid_block = CogLevel([widths[-1]] * (MIDDLE_BLOCKS + 1), groups)
        self.norm_out = make_norm(widths[-1], groups, 0)
        self.conv_out = CogCausalConv3d(widths[-1], 2 * config.latent_channels)

    def forward(
        self, video: Float[Tensor, "b 3 t h w"], history: History
    ) -> Float[Tensor, "b c t2 h2 w2"]:
        """1 + 4 k frames at the beginning of a video, and 4 k frames later."""
        features = self.conv_in(video, history)
        for level in self.down_blocks:
            features = level(features, history)
        features = self.mid_block(features, history)
        return self.conv_out(torch.nn.functional.silu(self.norm_out(features)), history)


class CogDecoder(nn.Module):
    """Latents to pixels; every norm sees the latents too."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths, groups, latent = config.widths[::-1], config.groups, config.latent_channels
        self.conv_in = CogCausalConv3d(latent, widths[0])
        self.mid_block = CogLevel([widths[0]] * (MIDDLE_BLOCKS + 1), groups, latent)
        pairs = zip((widths[0], *widths), widths, _changes(widths), strict=False)
        self.up_blocks = nn.ModuleList(
            CogUpLevel([before] + [width] * (config.blocks + 1), groups, latent, in_time)
            for before, width, in_time in pairs
        )
        self.norm_out = make_norm(widths[-1], groups, latent)
        self.conv_out = CogCausalConv3d(widths[-1], 3)

    def forward(
        self, latent: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b 3 t2 h2 w2"]:
        """Four frames per latent frame; one for the first of a video."""
        features = self.mid_block(self.conv_in(latent, history), history, latent)
        for level in self.up_blocks:
            features = level(features, history, latent)
        features = self.norm_out(features, latent, history.starts)
        return self.conv_out(torch.nn.functional.silu(features), history)


def _changes(widths: tuple[int, ...]) -> list[bool | None]:
    """Whether the way from each resolution changes time; None after the last one."""
    return [level < TIME_LEVELS for level in range(len(widths) - 1)] + [None]
