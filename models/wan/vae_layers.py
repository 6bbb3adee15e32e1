"""Layers of Wan's autoencoder: residual block, attention in a frame, resampling.

Axes: ``b`` batch, ``c`` channels, ``t`` frames, ``h w`` pixels. Attributes carry the names of the
public weights.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.video_vae.layers import repeat_pixels
from diff4splat.models.wan.history import History, WanCausalConv3d, WanRmsNorm


class WanResidualBlock(nn.Module):
    """Shortcut + conv(silu(norm(conv(silu(norm(x))))))."""

    def __init__(self, channels: int, out_channels: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = WanRmsNorm(channels, 3), WanRmsNorm(out_channels, 3)
        self.conv1 = WanCausalConv3d(channels, out_channels)
        self.conv2 = WanCausalConv3d(out_channels, out_channels)
        changes = channels != out_channels
        self.conv_shortcut = nn.Conv3d(channels, out_channels, 1) if changes else nn.Identity()

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t h w"]:
        """Two causal convolutions beside the shortcut."""
        hidden = self.conv1(torch.nn.functional.silu(self.norm1(frames)), history)
        hidden = self.conv2(torch.nn.functional.silu(self.norm2(hidden)), history)
        return hidden + self.conv_shortcut(frames)


class WanFrameAttention(nn.Module):
    """One head over all pixels of a frame."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm = WanRmsNorm(channels, 2)
        self.to_qkv = nn.Conv2d(channels, 3 * channels, 1)
        self.proj = nn.Conv2d(channels, channels, 1)

    def forward(self, frames: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c t h w"]:
        """Frames do not see each other."""
        batch, _, _, height, _ = frames.shape
        flat = frames.transpose(1, 2).flatten(0, 1)
        joint = self.to_qkv(self.norm(flat)).flatten(2).mT[:, None].contiguous()
        query, key, value = joint.chunk(3, -1)
        mixed = torch.nn.functional.scaled_dot_product_attention(query, key, value)
        update = self.proj(mixed[:, 0].mT.unflatten(2, (height, -1)))
        return frames + update.unflatten(0, (batch, -1)).transpose(1, 2)


class WanMidBlock(nn.Module):
    """Residual block, attention, residual block."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.resnets = nn.ModuleList([WanResidualBlock(channels, channels) for _ in range(2)])
        self.attentions = nn.ModuleList([WanFrameAttention(channels)])

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c t h w"]:
        """In this order."""
        frames = self.attentions[0](self.resnets[0](frames, history))
        return self.resnets[1](frames, history)


class WanDownsample(nn.Module):
    """Half the pixels per side; ``in_time``: frame 0, then one frame of every two."""

    def __init__(self, channels: int, in_time: bool) -> None:
        super().__init__()
        self.resample = nn.Sequential(
            nn.ZeroPad2d((0, 1, 0, 1)), nn.Conv2d(channels, channels, 3, 2)
        )
        if in_time:
            self.time_conv = nn.Conv3d(channels, channels, (3, 1, 1), (2, 1, 1))
        self.in_time = in_time

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c t2 h2 w2"]:
        """A later frame depends on the two that it stands for and the one before them."""
        small = per_frame(self.resample, frames)
        if not self.in_time:
            return small
        extended = history.prepend(small, 1)
        if not history.starts:
            return self.time_conv(extended)
        first, rest = small[:, :, :1], small.shape[2] > 1
        return torch.cat([first, self.time_conv(small)], 2) if rest else first


class WanUpsample(nn.Module):
    """Twice the pixels per side; ``in_time``: frame 0, then two frames of every later one."""

    def __init__(self, channels: int, out_channels: int, in_time: bool) -> None:
        super().__init__()
        self.resample = nn.Sequential(
            nn.Identity(), nn.Conv2d(channels, out_channels, 3, padding=1)
        )
        if in_time:
            self.time_conv = WanCausalConv3d(channels, 2 * channels, space=1)
        self.in_time = in_time

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Frames are split from channels; pixels are repeated, then smoothed."""
        if self.in_time:
            frames = self._more_frames(frames, history)
        return per_frame(self.resample, repeat_pixels(frames))

    def _more_frames(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c t2 h w"]:
        """Frame 0 neither passes the convolution nor is part of its history."""
        later = frames[:, :, 1:] if history.starts else frames
        doubled = self.time_conv(later, history) if later.shape[2] else self._begin(later, history)
        doubled = doubled.unflatten(1, (2, -1)).permute(0, 2, 3, 1, 4, 5).flatten(2, 3)
        return torch.cat([frames[:, :, :1], doubled], 2) if history.starts else doubled

    def _begin(self, later: Tensor, history: History) -> Tensor:
        """No frames yet: only their history of zeros is noted."""
        history.prepend(later, 2)
        return later.new_zeros(later.shape[0], 2 * later.shape[1], *later.shape[2:])


def per_frame(
    layer: nn.Module, frames: Float[Tensor, "b c t h w"]
) -> Float[Tensor, "b c2 t h2 w2"]:
    """A layer over images, applied to each frame."""
    flat = frames.transpose(1, 2).flatten(0, 1)
    return layer(flat).unflatten(0, (frames.shape[0], -1)).transpose(1, 2)
