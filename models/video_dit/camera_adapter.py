"""Plücker maps to tokens that are added to the patch embedding (Wan-Fun camera control).

Axes: ``b`` batch, ``f`` = 1 + 4 k video frames, ``hh ww`` pixels, ``t h w`` token grid, ``d``
token width.

    (b, 6, f, hh, ww) → four frames as channels: 24 → pixel-unshuffle by the VAE's stride s: 24 s²
      → convolution, kernel = stride = 2 → residual block (conv, ReLU, conv) → linear, zero at first

Wan-Fun ends at the residual block; the zero layer after it makes a fresh adapter leave the backbone
exactly as it was, and lets the adapter be narrower than the backbone.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.patches import pack_frames
from diff4splat.models.config.networks import TIME_STRIDE, TOKEN_PATCH

PLUCKER_CHANNELS = 6


class CameraAdapter(nn.Module):
    """One vector per token from the rays of its pixels."""

    def __init__(self, width: int, hidden_width: int, space_stride: int) -> None:
        super().__init__()
        self.space_stride = space_stride
        channels = PLUCKER_CHANNELS * TIME_STRIDE * space_stride**2
        self.conv_in = nn.Conv2d(channels, hidden_width, TOKEN_PATCH, TOKEN_PATCH)
        self.conv_1 = nn.Conv2d(hidden_width, hidden_width, 3, padding=1)
        self.conv_2 = nn.Conv2d(hidden_width, hidden_width, 3, padding=1)
        self.to_tokens = zero_(nn.Linear(hidden_width, width))

    def forward(self, camera: Float[Tensor, "b 6 f hh ww"]) -> Float[Tensor, "b t h w d"]:
        """Tokens of a Plücker map relative to the first camera."""
        packs = pack_frames(camera).transpose(1, 2)
        batch = packs.shape[0]
        cells = torch.nn.functional.pixel_unshuffle(packs.flatten(0, 1), self.space_stride)
        features = self.conv_in(cells)
        features = features + self.conv_2(torch.relu(self.conv_1(features)))
        return self.to_tokens(features.movedim(1, -1)).unflatten(0, (batch, -1))
