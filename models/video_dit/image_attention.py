"""Attention to text and to an image at once, with separate keys (Wan 2.1 image-to-video).

Axes: ``b`` batch, ``n`` video tokens, ``s`` text tokens, ``i`` image tokens, ``d`` width, ``e``
width of the image states. The two results are added before the output layer.

    image states ─ norm ─ linear, GELU, linear ─ norm ─ image tokens ─ own keys and values
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import Attention, attend
from diff4splat.models.blocks.norm import TokenRmsNorm

IMAGE_NORM_EPSILON = 1e-5
"""PyTorch's default, which Wan takes here alone."""


class ImageProjection(nn.Module):
    """Image states to the model's width."""

    def __init__(self, image_width: int, width: int) -> None:
        super().__init__()
        self.norm_in = nn.LayerNorm(image_width, eps=IMAGE_NORM_EPSILON)
        self.expand = nn.Linear(image_width, image_width)
        self.contract = nn.Linear(image_width, width)
        self.norm_out = nn.LayerNorm(width, eps=IMAGE_NORM_EPSILON)

    def forward(self, image: Float[Tensor, "b i e"]) -> Float[Tensor, "b i d"]:
        """Project every token separately."""
        hidden = torch.nn.functional.gelu(self.expand(self.norm_in(image)))
        return self.norm_out(self.contract(hidden))


class TextImageAttention(Attention):
    """Cross-attention to text, plus one with the same queries to an image."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__(width, heads)
        self.to_image_key = nn.Linear(width, width)
        self.to_image_value = nn.Linear(width, width)
        self.image_key_norm = TokenRmsNorm(width)

    def forward(
        self,
        tokens: Float[Tensor, "b n d"],
        context: Float[Tensor, "b s d"],
        mask: Tensor | None = None,
        image: Float[Tensor, "b i d"] | None = None,
    ) -> Float[Tensor, "b n d"]:
        """Without ``image`` text alone is attended to."""
        if image is None:
            return super().forward(tokens, context=context, mask=mask)
        query = self._split(self.query_norm(self.to_query(tokens)))
        key = self._split(self.key_norm(self.to_key(context)))
        bias = None if mask is None else mask[:, None, None]
        heads = attend(query, key, self._split(self.to_value(context)), bias)
        image_key = self._split(self.image_key_norm(self.to_image_key(image)))
        heads = heads + attend(query, image_key, self._split(self.to_image_value(image)))
        return self.to_output(heads)
