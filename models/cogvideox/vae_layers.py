"""Layers of CogVideoX's autoencoder: causal convolution, norms, residual block, resampling.

Axes: ``b`` batch, ``c`` channels, ``t`` frames of a chunk, ``h w`` pixels, ``z`` channels of the
latent. Before a video lies its first frame, repeated. Norms take statistics over a whole chunk, so
the cut into chunks belongs to the definition. Attributes carry the names of the public weights.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.video_vae.layers import repeat_pixels
from diff4splat.models.wan.history import HISTORY_FRAMES, History
from diff4splat.models.wan.vae_layers import per_frame

NORM_EPSILON = 1e-6


class FirstFrameHistory(History):
    """Before a video lies its first frame."""

    def before_video(self, frames: Float[Tensor, "b c t h w"], count: int) -> Tensor:
        """``count`` copies."""
        return frames[:, :, :1].expand(-1, -1, count, -1, -1)


class CogCausalConv3d(nn.Module):
    """Kernel of three frames and 3×3 pixels."""

    def __init__(self, channels: int, out_channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv3d(channels, out_channels, 3, padding=(0, 1, 1))

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t h w"]:
        """One output frame per input frame."""
        return self.conv(history.prepend(frames, HISTORY_FRAMES))


class PointConv3d(nn.Module):
    """Kernel of one pixel, under the name of a causal one."""

    def __init__(self, channels: int, out_channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv3d(channels, out_channels, 1)

    def forward(self, frames: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c2 t h w"]:
        """Every pixel separately."""
        return self.conv(frames)


class CogGroupNorm(nn.GroupNorm):
    """Group norm with the calls of ``SpatialNorm``."""

    def __init__(self, channels: int, groups: int) -> None:
        super().__init__(groups, channels, eps=NORM_EPSILON)

    def forward(
        self, frames: Float[Tensor, "b c t h w"], latent: None = None, starts: bool = True
    ) -> Float[Tensor, "b c t h w"]:
        """Statistics of the whole chunk."""
        del latent, starts
        return super().forward(frames)


class SpatialNorm(nn.Module):
    """Group norm whose gain and shift are read off the latent (arXiv 2209.09002)."""

    def __init__(self, channels: int, groups: int, latent_channels: int) -> None:
        super().__init__()
        self.norm_layer = nn.GroupNorm(groups, channels, eps=NORM_EPSILON)
        self.conv_y = PointConv3d(latent_channels, channels)
        self.conv_b = PointConv3d(latent_channels, channels)

    def forward(
        self,
        frames: Float[Tensor, "b c t h w"],
        latent: Float[Tensor, "b z t2 h2 w2"],
        starts: bool,
    ) -> Float[Tensor, "b c t h w"]:
        """Convolved before they are spread: the same numbers for a fraction of the work."""
        gain, shift = (
            spread(conv(latent), tuple(frames.shape[2:]), starts)
            for conv in (self.conv_y, self.conv_b)
        )
        return torch.addcmul(shift, self.norm_layer(frames), gain)


def spread(
    latent: Float[Tensor, "b c t h w"], size: tuple[int, int, int], starts: bool
) -> Float[Tensor, "b c t2 h2 w2"]:
    """Nearest values at a finer ``size``; frame 0 of a video stays one frame."""
    if tuple(latent.shape[2:]) == size:
        return latent
    if not starts or latent.shape[2] == 1:
        return torch.nn.functional.interpolate(latent, size=size)
    first = torch.nn.functional.interpolate(latent[:, :, :1], size=(1, *size[1:]))
    rest = torch.nn.functional.interpolate(latent[:, :, 1:], size=(size[0] - 1, *size[1:]))
    return torch.cat([first, rest], 2)


class CogResidualBlock(nn.Module):
    """Shortcut + conv(silu(norm(conv(silu(norm(x)))))); ``latent_channels`` 0: plain norms."""

    def __init__(self, channels: int, out_channels: int, groups: int, latent_channels: int) -> None:
        super().__init__()
        self.norm1 = make_norm(channels, groups, latent_channels)
        self.norm2 = make_norm(out_channels, groups, latent_channels)
        self.conv1 = CogCausalConv3d(channels, out_channels)
        self.conv2 = CogCausalConv3d(out_channels, out_channels)
        changes = channels != out_channels
        self.conv_shortcut = nn.Conv3d(channels, out_channels, 1) if changes else nn.Identity()

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History, latent: Tensor | None = None
    ) -> Float[Tensor, "b c2 t h w"]:
        """Two causal convolutions beside the shortcut."""
        silu, starts = torch.nn.functional.silu, history.starts
        hidden = self.conv1(silu(self.norm1(frames, latent, starts)), history)
        hidden = self.conv2(silu(self.norm2(hidden, latent, starts)), history)
        return hidden + self.conv_shortcut(frames)


def make_norm(channels: int, groups: int, latent_channels: int) -> nn.Module:
    """Spatial in the decoder, plain in the encoder."""
    if latent_channels:
        return SpatialNorm(channels, groups, latent_channels)
    return CogGroupNorm(channels, groups)


class CogDownsample(nn.Module):
    """Half the pixels per side; ``in_time``: frame 0, then the mean of every two frames."""

    def __init__(self, channels: int, in_time: bool) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, 3, 2)
        self.in_time = in_time

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c t2 h2 w2"]:
        """Means over time, then a strided convolution with zeros to the right and below."""
        if self.in_time:
            rest = frames[:, :, 1:] if history.starts else frames
            rest = rest.unflatten(2, (-1, 2)).mean(3)
            frames = torch.cat([frames[:, :, :1], rest], 2) if history.starts else rest
        return per_frame(self.conv, torch.nn.functional.pad(frames, (0, 1, 0, 1)))


class CogUpsample(nn.Module):
    """Twice the pixels per side; ``in_time``: frame 0, then every later frame twice."""

    def __init__(self, channels: int, in_time: bool) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, 3, padding=1)
        self.in_time = in_time

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c t2 h2 w2"]:
        """Pixels are repeated and smoothed, then frames are repeated: equal ones cost once."""
        frames = per_frame(self.conv, repeat_pixels(frames))
        if not self.in_time:
            return frames
        rest = frames[:, :, 1:] if history.starts else frames
        rest = rest.repeat_interleave(2, 2)
        return torch.cat([frames[:, :, :1], rest], 2) if history.starts else rest
