"""Errors of the pixels that prompts ask to move.

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.metrics.masked import masked_mean

SMOOTHING_PX = 1.0
"""Added to both areas, so that a missed speck has a finite gradient."""

INSTANCE_WEIGHT = 4.0
"""Of the cross-entropy of instances, against their overlap."""
AREA_RANGE_PX = (80.0, 8000.0)
"""Areas beyond count as these: a small object's pixels weigh up to 4.5 times as much."""

HIGHEST_PX = 80
"""Of an image in which nothing is asked for."""
NO_NAME_WEIGHT = 0.15
"""Of pixels of the ground, walls and the sky: most of an image."""
UNKNOWN_NAME = 255
"""In maps of names, of a pixel whose noun or colour has no number."""
_LEAST_WEIGHT = 1e-6


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
    truth = masks.flatten(2)
    return masked_mean(_dice(logits.flatten(2), truth), truth.any(-1))


def absent_error(
    logits: Float[Tensor, "b r h w"], masks: Bool[Tensor, "b r h w"]
) -> Float[Tensor, " b"]:
    """Cross-entropy of the most probable pixels, mean over prompts that ask for nothing."""
    highest = logits.flatten(2).topk(min(HIGHEST_PX, logits[0, 0].numel()), -1).values
    error = torch.nn.functional.softplus(highest).mean(-1)
    return masked_mean(error, ~masks.flatten(2).any(-1))


def _dice(logits: Float[Tensor, "b r p"], truth: Bool[Tensor, "b r p"]) -> Float[Tensor, "b r"]:
    truth, predicted = truth.to(logits), logits.sigmoid()
    both = truth.sum(-1) + predicted.sum(-1)
    return 1 - (2 * (truth * predicted).sum(-1) + SMOOTHING_PX) / (both + SMOOTHING_PX)


def name_error(
    logits: Float[Tensor, "b n h w"], names: Int[Tensor, "b h w"]
) -> Float[Tensor, " b"]:
    """Cross-entropy of the name of every pixel; 0 without any.

    Name 0 is no name, and counts for less; ``UNKNOWN_NAME`` does not count.
    """
    error = torch.nn.functional.cross_entropy(
        logits, names, reduction="none", ignore_index=UNKNOWN_NAME
    )
    weights = torch.where(names > 0, 1.0, NO_NAME_WEIGHT).to(error) * (names != UNKNOWN_NAME)
    return (error * weights).flatten(1).sum(1) / weights.flatten(1).sum(1).clamp_min(_LEAST_WEIGHT)


def instance_error(
    logits: Float[Tensor, "b s h w"], masks: Bool[Tensor, "b s h w"], valid: Bool[Tensor, "b s"]
) -> Float[Tensor, " b"]:
    """Cross-entropy and 1 − overlap of what belongs to the object of each seed; 0 without any.

    Pixels of the object weigh by the root of half the image's area over the object's.
    """
    truth, flat = masks.flatten(2), logits.flatten(2)
    area = truth.sum(-1, keepdim=True).clamp(*AREA_RANGE_PX)
    weight = (truth.shape[-1] / (2 * area)).clamp(1, 20).sqrt()
    error = torch.nn.functional.binary_cross_entropy_with_logits(
        flat, truth.to(flat), reduction="none"
    )
    error = (error * torch.where(truth, weight, 1.0)).mean(-1)
    return masked_mean(INSTANCE_WEIGHT * error + _dice(flat, truth), valid)
