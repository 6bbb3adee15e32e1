"""Latents to tokens, where some channels are the same at all steps.

Axes: ``b`` batch, ``c`` noisy channels, ``c2`` others, ``t h w`` latent frames, rows and columns,
``d`` width. One linear layer over the channels of a patch: the noisy ones first.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.patches import patchify
from diff4splat.models.video_dit.conditions import RenderCondition

Patch = tuple[int, int, int]


def latent_tokens(
    layer: nn.Linear, latent: Float[Tensor, "b c t h w"], patch: Patch, others: int
) -> Float[Tensor, "b t2 h2 w2 d"]:
    """The part of the noisy channels, with the bias; ``others`` is the number c2."""
    patches = patchify(latent, patch)
    if not others:
        return layer(patches)
    weight = layer.weight[:, : layer.in_features - others * math.prod(patch)]
    return torch.nn.functional.linear(patches, weight, layer.bias)


def channel_tokens(
    layer: nn.Linear, channels: Float[Tensor, "b c2 t h w"] | None, patch: Patch, others: int
) -> Float[Tensor, "b t2 h2 w2 d"] | None:
    """The part of the channels after them."""
    if channels is None:
        return None
    weight = layer.weight[:, layer.in_features - others * math.prod(patch) :]
    return torch.nn.functional.linear(patchify(channels, patch), weight)


def require_render_condition(wanted: bool, condition: RenderCondition | None) -> None:
    """Refuse a render condition that is missing, or given to a model that takes none.

    Raises:
        ShapeError: either.
    """
    if wanted != (condition is not None):
        want, got = ("one", "none") if wanted else ("none", "one")
        raise ShapeError(
            f"render condition: expected {want}, got {got}; DitConfig.render_condition decides"
        )
