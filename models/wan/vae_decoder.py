"""Decoder of Wan's autoencoder: a chunk of latents to video.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns. A resolution has one residual
block more than in the encoder. In Wan 2.1 upsampling halves the channels.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.video_vae.encoder import halves_time
from diff4splat.models.wan.history import History, WanCausalConv3d, WanRmsNorm
from diff4splat.models.wan.vae_layers import WanMidBlock, WanResidualBlock, WanUpsample
from diff4splat.models.wan.vae_shortcuts import duplicate_up


class WanUpBlock(nn.Module):
    """A resolution of Wan 2.1 and the way to the next finer one; None: there is none."""

    def __init__(self, channels: int, out_channels: int, blocks: int, doubles: bool | None) -> None:
        super().__init__()
        widths = [channels] + [out_channels] * (blocks + 1)
        self.resnets = nn.ModuleList(map(WanResidualBlock, widths, widths[1:]))
        if doubles is not None:
            up = WanUpsample(out_channels, out_channels // 2, doubles)
            self.upsamplers = nn.ModuleList([up])
        self.has_finer = doubles is not None

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Residual blocks, then upsampling."""
        for block in self.resnets:
            frames = block(frames, history)
        return self.upsamplers[0](frames, history) if self.has_finer else frames


class WanShortcutUpBlock(nn.Module):
    """The same of Wan 2.2, beside a shortcut."""

    def __init__(self, channels: int, out_channels: int, blocks: int, doubles: bool | None) -> None:
        super().__init__()
        widths = [channels] + [out_channels] * (blocks + 1)
        self.resnets = nn.ModuleList(map(WanResidualBlock, widths, widths[1:]))
        finer = doubles is not None
        self.upsampler = WanUpsample(out_channels, out_channels, doubles) if finer else None
        self.factor = (2 if doubles else 1, 2)
        self.out_channels = out_channels

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Residual blocks and upsampling beside repeated channels."""
        hidden = frames
        for block in self.resnets:
            hidden = block(hidden, history)
        if self.upsampler is None:
            return hidden
        shortcut = duplicate_up(frames, self.out_channels, self.factor, history.starts)
        return self.upsampler(hidden, history) + shortcut


class WanDecoder(nn.Module):
    """Latents to pixels, folded by the pixel patch."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths = (config.decoder_widths or config.widths)[::-1]
        self.conv_in = WanCausalConv3d(config.latent_channels, widths[0])
        self.mid_block = WanMidBlock(widths[0])
        self.up_blocks = nn.ModuleList(_levels(config, widths))
        self.norm_out = WanRmsNorm(widths[-1], 3)
        self.conv_out = WanCausalConv3d(widths[-1], 3 * config.pixel_patch**2)

    def forward(
        self, latent: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Any number of latent frames in a row."""
        features = self.mid_block(self.conv_in(latent, history), history)
        for block in self.up_blocks:
            features = block(features, history)
        return self.conv_out(torch.nn.functional.silu(self.norm_out(features)), history)


def _levels(config: VaeConfig, widths: tuple[int, ...]) -> list[nn.Module]:
    """Coarsest first."""
    halves = config.layout == "wan2.1"
    kind = WanUpBlock if halves else WanShortcutUpBlock
    before = (widths[0], *(width // 2 if halves else width for width in widths[:-1]))
    last = len(widths) - 1
    doubles = [
        halves_time(last - level, last + 1) if level < last else None for level in range(last + 1)
    ]
    return [
        kind(channels, width, config.blocks, double)
        for channels, width, double in zip(before, widths, doubles, strict=True)
    ]
