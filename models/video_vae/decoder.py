"""Decoder of the video autoencoder, as a pure function of one chunk and its caches.

Axes: ``b`` batch, ``c`` channels, ``t h w`` latent frames, rows and columns. Every latent frame
gives four video frames. The first three of a video come before its first frame and are thrown away
by the caller: with that, all chunks run the same graph, the first included.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.causal_conv import HISTORY_FRAMES, CausalConv3d, FrameMemory
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.blocks.patches import unpatchify
from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.video_vae.encoder import halves_time
from diff4splat.models.video_vae.layers import Upsample, VaeBlock


class VaeDecoder(nn.Module):
    """Latent frames to pixels, about [−1, 1] and not clamped."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        widths = config.widths
        self.patch = (1, config.pixel_patch, config.pixel_patch)
        self.conv_in = CausalConv3d(config.latent_channels, widths[-1])
        layers: list[nn.Module] = []
        for level in range(len(widths) - 1, 0, -1):
            layers += [VaeBlock(widths[level]) for _ in range(config.blocks)]
            layers.append(
                Upsample(widths[level], widths[level - 1], halves_time(level, len(widths)))
            )
        layers += [VaeBlock(widths[0]) for _ in range(config.blocks)]
        self.layers = nn.ModuleList(layers)
        self.norm_out = ChannelRmsNorm(widths[0])
        self.conv_out = CausalConv3d(widths[0], 3 * config.pixel_patch**2)

    def forward(
        self, latent: Float[Tensor, "b c t h w"], caches: tuple[Tensor, ...]
    ) -> tuple[Float[Tensor, "b 3 t4 h8 w8"], tuple[Tensor, ...]]:
        """Four frames per latent frame, and the caches for the next chunk."""
        memory = FrameMemory(caches)
        features = self.conv_in(latent, memory)
        for layer in self.layers:
            features = layer(features, memory)
        pixels = self.conv_out(torch.nn.functional.silu(self.norm_out(features)), memory)
        return unpatchify(pixels.movedim(1, -1), self.patch), memory.caches

    def initial_caches(self, latent: Float[Tensor, "b c t h w"]) -> tuple[Tensor, ...]:
        """Black memory before the first chunk: one tensor per causal convolution, in call order."""
        batch, size = latent.shape[0], latent.shape[3:]
        caches = []
        for layer in (self.conv_in, *self.layers, self.conv_out):
            for conv in layer.modules():
                if isinstance(conv, CausalConv3d):
                    caches.append(
                        latent.new_zeros(batch, conv.conv.in_channels, HISTORY_FRAMES, *size)
                    )
            if isinstance(layer, Upsample):
                size = (2 * size[0], 2 * size[1])
        return tuple(caches)
