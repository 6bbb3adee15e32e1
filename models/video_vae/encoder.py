"""Encoder of the video autoencoder: 1 + 4 k frames to 1 + k latent frames.

Axes: ``b`` batch, ``c`` channels, ``f`` video frames, ``t h w`` latent frames, rows and columns.
The first frame is repeated before the video. An image is therefore the case
f = 1, and latent frame 0 of any video is the latent of its first frame alone.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.causal_conv import CausalConv3d, FrameMemory
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.blocks.patches import patchify
from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.video_vae.layers import Downsample, VaeBlock


def halves_time(level: int, levels: int) -> bool:
    """Time is halved between the last three resolutions only, as in Wan 2.1."""
    return level >= levels - 2


class VaeEncoder(nn.Module):
    """Pixels in [−1, 1] to mean and log-variance, 2 c channels."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths = config.widths
        self.patch = (1, config.pixel_patch, config.pixel_patch)
        self.conv_in = CausalConv3d(3 * config.pixel_patch**2, widths[0])
        layers: list[nn.Module] = [VaeBlock(widths[0]) for _ in range(config.blocks)]
        for level in range(1, len(widths)):
            layers.append(
                Downsample(widths[level - 1], widths[level], halves_time(level, len(widths)))
            )
            layers += [VaeBlock(widths[level]) for _ in range(config.blocks)]
        self.layers = nn.ModuleList(layers)
        self.norm_out = ChannelRmsNorm(widths[-1])
        self.conv_out = CausalConv3d(widths[-1], 2 * config.latent_channels)

    def forward(self, video: Float[Tensor, "b 3 f h8 w8"]) -> Float[Tensor, "b c2 t h w"]:
        """Mean and log-variance, stacked as channels."""
        memory = FrameMemory()
        features = self.conv_in(patchify(video, self.patch).movedim(-1, 1), memory)
        for layer in self.layers:
            features = layer(features, memory)
        return self.conv_out(torch.nn.functional.silu(self.norm_out(features)), memory)
