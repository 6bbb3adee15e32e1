"""Errors of the pixels that prompts ask to move.

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.metrics.masked import masked_mean

SMOOTHING_PX = 1.0
"""Added to both areas, so that a missed speck has a finite gradient."""

NO_NAME_WEIGHT = 0.15
"""Of pixels of the ground, walls and the sky: most of an image."""


def cross_entropy(
    logits: Float[Tensor, "b *r h w"], masks: Bool[Tensor, "b *r h w"]
) -> Float[Tensor, " b"]:
    """Mean over pixels, and over prompts where an image has several."""
    error = torch.nn.functional.binary_cross_entropy_with_logits(
        logits, masks.to(logits), reduction="none"
    )
    return error.flatten(1).mean(1)


def dice_error(
    logits: Float[Tensor, "b r h w"], masks: Bool[Tensor, "b r h w"]
) -> Float[Tensor, " b"]:
    """1 − 2 Σ p m / Σ (p + m), mean over prompts that ask for something; 0 without any.

    (V-Net, arXiv 1606.04797, eq. 1 without squares.)
    """
    truth, predicted = masks.flatten(2).to(logits), logits.flatten(2).sigmoid()
    shared = (truth * predicted).sum(-1)
    both = truth.sum(-1) + predicted.sum(-1)
    error = 1 - (2 * shared + SMOOTHING_PX) / (both + SMOOTHING_PX)
    return masked_mean(error, masks.flatten(2).any(-1))


def name_error(
    logits: Float[Tensor, "b n h w"], names: Int[Tensor, "b h w"]
) -> Float[Tensor, " b"]:
    """Cross-entropy of the name of every pixel; 0 is no name, and counts for less."""
    error = torch.nn.functional.cross_entropy(logits, names, reduction="none")
    weights = torch.where(names > 0, 1.0, NO_NAME_WEIGHT).to(error)
    return (error * weights).flatten(1).sum(1) / weights.flatten(1).sum(1)
