"""Probability of motion shared among the pixels of one object (ADR 36).

Words find the most telling part of an object; vectors of the object mask know what belongs to it.
What may belong to an object counts less than what surely does: membership counts squared.
Axes: ``h w`` pixels, ``s`` cells, ``c`` channels of a vector, ``k`` with its log scale.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.object_mask.instance_vectors import pair_logits

MOST_CELLS = 4096
"""Cells that a mean is over: of two pixels in an image of 128 by 128, larger in longer ones."""
MEAN_WEIGHT = 0.4
"""Of the mean over the object's pixels, against the pixel's own probability."""
LOW_SHARE = 0.35
"""Of the highest probability, above which a pixel moves: what is of the object alone has 0.4. All
chosen on validation worlds (docs/log/object-mask-backbone.md)."""
SMALLEST = 1e-6
CHUNK = 1024
"""Pixels at a time: memory is that times the number of cells."""


def pooled_by_object(
    probability: Float[Tensor, "h w"], instances: Float[Tensor, "k h w"]
) -> Float[Tensor, "h w"]:
    """A pixel's own, and the mean over the pixels of its object; the highest stays about as it is.

    ``instances`` are vectors and log scales of ``models.object_mask.instance_vectors``.
    """
    highest = probability.max()
    if highest <= 0:
        return probability
    means = _mean_over_object(probability, instances)
    # Vectors so long that no cell is like another leave no mean.
    means = means / means.max().clamp_min(SMALLEST)
    return highest * torch.lerp(probability / highest, means, MEAN_WEIGHT)


def _mean_over_object(
    probability: Float[Tensor, "h w"], instances: Float[Tensor, "k h w"]
) -> Float[Tensor, "h w"]:
    maps = torch.cat([instances, probability[None]])
    side_px = max(math.ceil(math.sqrt(probability.numel() / MOST_CELLS)), 2)
    cells = torch.nn.functional.avg_pool2d(maps[None], side_px, ceil_mode=True)[0].flatten(1)
    vectors, log_scales, values = cells[:-2].mT, cells[-2], cells[-1]
    summed = torch.stack([values, torch.ones_like(values)], 1)
    sums = []
    for part in instances[:-1].flatten(1).mT.split(CHUNK):
        membership = pair_logits(part, vectors, log_scales).sigmoid_()
        sums.append(membership.mul_(membership) @ summed)
    above, below = torch.cat(sums).unbind(1)
    return (above / below.clamp_min(SMALLEST)).view_as(probability)
