"""Vision transformer of CLIP (arXiv 2103.00020), as Wan 2.1 image-to-video takes its states.

Axes: ``b`` images, ``h w`` pixels, ``i`` = 1 + patches, ``d`` width.

    image ─ scale, cut, normalise ─ patches ─ linear ─┐
    class token ──────────────────────────────────────┴─ + positions ─ norm ─ blocks ─ states
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import attend
from diff4splat.models.config.image_encoder import ImageEncoderConfig

EPSILON = 1e-5
MEAN, STD = (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
"""Of the colours that CLIP was trained on."""


def _quick_gelu(hidden: Tensor) -> Tensor:
    return hidden * torch.sigmoid(1.702 * hidden)


ACTIVATIONS: dict[str, Callable[[Tensor], Tensor]] = {
    "gelu": torch.nn.functional.gelu,
    "quick_gelu": _quick_gelu,
}


class ClipBlock(nn.Module):
    """x + attention(norm(x)), then x + perceptron(norm(x))."""

    def __init__(self, config: ImageEncoderConfig) -> None:
        super().__init__()
        width = config.width
        self.heads, self.activation = config.heads, config.activation
        self.attention_norm = nn.LayerNorm(width, eps=EPSILON)
        self.to_query, self.to_key = nn.Linear(width, width), nn.Linear(width, width)
        self.to_value, self.to_output = nn.Linear(width, width), nn.Linear(width, width)
        self.feedforward_norm = nn.LayerNorm(width, eps=EPSILON)
        self.expand = nn.Linear(width, config.feedforward_width)
        self.contract = nn.Linear(config.feedforward_width, width)

    def forward(self, states: Float[Tensor, "b i d"]) -> Float[Tensor, "b i d"]:
        """Every token attends to every other."""
        normed = self.attention_norm(states)
        query, key, value = (
            layer(normed).unflatten(-1, (self.heads, -1))
            for layer in (self.to_query, self.to_key, self.to_value)
        )
        states = states + self.to_output(attend(query, key, value))
        hidden = ACTIVATIONS[self.activation](self.expand(self.feedforward_norm(states)))
        return states + self.contract(hidden)


class ClipImageEncoder(nn.Module):
    """Images to one state per patch, and one for the whole."""

    def __init__(self, config: ImageEncoderConfig) -> None:
        super().__init__()
        self.config = config
        width, side = config.width, config.size_px // config.patch_px
        self.patch_embedding = nn.Linear(3 * config.patch_px**2, width, bias=False)
        self.class_embedding = nn.Parameter(torch.zeros(width))
        self.position_embedding = nn.Parameter(torch.zeros(1 + side**2, width))
        self.norm_in = nn.LayerNorm(width, eps=EPSILON)
        self.blocks = nn.ModuleList([ClipBlock(config) for _ in range(config.blocks)])

    def forward(self, pixels: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b i d"]:
        """States of images that are scaled, cut and normalised."""
        patches = torch.nn.functional.pixel_unshuffle(pixels, self.config.patch_px)
        tokens = self.patch_embedding(patches.flatten(2).mT)
        first = self.class_embedding.expand(tokens.shape[0], 1, -1).to(tokens.dtype)
        states = self.norm_in(torch.cat([first, tokens], 1) + self.position_embedding)
        for block in self.blocks:
            states = block(states)
        return states

    def encode_image(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b i d"]:
        """States of images of any size, in [0, 1]."""
        pixels = clip_pixels(image, self.config.size_px)
        return self(pixels.to(self.patch_embedding.weight.dtype))


def clip_pixels(image: Float[Tensor, "b 3 h w"], side_px: int) -> Float[Tensor, "b 3 s s"]:
    """The short side scaled to ``side_px``, the middle square, colours normalised."""
    height, width = image.shape[2:]
    scale = side_px / min(height, width)
    size = tuple(max(int(side * scale), side_px) for side in (height, width))
    small = torch.nn.functional.interpolate(
        image.float(), size=size, mode="bicubic", antialias=True, align_corners=False
    ).clamp(0, 1)
    top, left = ((side - side_px) // 2 for side in size)
    cut = small[:, :, top : top + side_px, left : left + side_px]
    mean, std = (cut.new_tensor(each).view(3, 1, 1) for each in (MEAN, STD))
    return (cut - mean) / std
