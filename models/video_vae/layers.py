"""Layers of the video autoencoder: residual block, downsampling and upsampling.

Axes: ``b`` batch, ``c`` channels, ``t`` frames, ``h w`` pixels. Every normalisation is per
position and every convolution over time is causal, so a video may be processed in chunks without a
difference.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.causal_conv import CausalConv3d, FrameMemory
from diff4splat.models.blocks.norm import ChannelRmsNorm


class VaeBlock(nn.Module):
    """x + conv(silu(norm(conv(silu(norm(x))))))."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm_1, self.norm_2 = ChannelRmsNorm(channels), ChannelRmsNorm(channels)
        self.conv_1, self.conv_2 = (
            CausalConv3d(channels, channels),
            CausalConv3d(channels, channels),
        )

    def forward(
        self, frames: Float[Tensor, "b c t h w"], memory: FrameMemory
    ) -> Float[Tensor, "b c t h w"]:
        """Two causal convolutions with a skip connection."""
        hidden = self.conv_1(torch.nn.functional.silu(self.norm_1(frames)), memory)
        return frames + self.conv_2(torch.nn.functional.silu(self.norm_2(hidden)), memory)


class Downsample(nn.Module):
    """Half the pixels per side and, when ``in_time``, 1 + 2 k frames to 1 + k."""

    def __init__(self, channels: int, out_channels: int, in_time: bool) -> None:
        super().__init__()
        self.conv = CausalConv3d(channels, out_channels, stride=(2 if in_time else 1, 2, 2))

    def forward(
        self, frames: Float[Tensor, "b c t h w"], memory: FrameMemory
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Output frame i depends on input frames 2i−2, 2i−1 and 2i."""
        return self.conv(frames, memory)


class Upsample(nn.Module):
    """Twice the pixels per side and, when ``in_time``, two frames from each."""

    def __init__(self, channels: int, out_channels: int, in_time: bool) -> None:
        super().__init__()
        self.in_time = in_time
        if in_time:
            self.time_conv = CausalConv3d(channels, 2 * channels, space=1)
        self.space_conv = nn.Conv3d(channels, out_channels, (1, 3, 3), padding=(0, 1, 1))

    def forward(
        self, frames: Float[Tensor, "b c t h w"], memory: FrameMemory
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Frames are split from channels; pixels are repeated, then smoothed by a convolution."""
        if self.in_time:
            pairs = self.time_conv(frames, memory).unflatten(1, (2, -1))
            frames = pairs.permute(0, 2, 3, 1, 4, 5).flatten(2, 3)
        return self.space_conv(repeat_pixels(frames))


def repeat_pixels(frames: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c t h2 w2"]:
    """Nearest-neighbour doubling; cheaper than ``interpolate`` in ONNX Runtime and bit-equal."""
    batch, channels, time, height, width = frames.shape
    wide = frames[..., :, None, :, None].expand(batch, channels, time, height, 2, width, 2)
    return wide.flatten(5).flatten(3, 4)
