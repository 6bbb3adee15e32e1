"""The render condition: the layered image along the path, and which of its pixels are valid.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``h2 w2`` tokens, ``d`` width. Image-to-3D video models are conditioned
like this (ViewCrafter, arXiv 2409.02048; GEN3C, arXiv 2503.03751): valid pixels are visible in the
input image, all others are to be filled.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.patches import fill_first_pack, patchify
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.config.networks import TIME_STRIDE, TOKEN_PATCH
from diff4splat.models.video_dit.conditions import RenderCondition


class RenderConditionEmbedding(nn.Module):
    """Tokens of a render condition; zero when fresh."""

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        self.latent = zero_(nn.Linear(channels * TOKEN_PATCH**2, width))
        self.validity = zero_(nn.Linear(TIME_STRIDE * TOKEN_PATCH**2, width, bias=False))

    def forward(self, condition: RenderCondition) -> Float[Tensor, "b t h2 w2 d"]:
        """One token per 2×2 latent pixels; validity is averaged over each latent pixel."""
        latent = patchify(condition.latent, (1, TOKEN_PATCH, TOKEN_PATCH))
        side_px = condition.validity.shape[-1] // condition.latent.shape[-1]
        validity = at_least_float32(condition.validity)
        share = torch.nn.functional.avg_pool3d(validity, (1, side_px, side_px))
        share = patchify(fill_first_pack(share), (TIME_STRIDE, TOKEN_PATCH, TOKEN_PATCH))
        return self.latent(latent) + self.validity((1 - share).to(latent))
