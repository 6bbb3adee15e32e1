"""Probability of motion shared among the pixels of one object, so that it moves whole (ADR 36).

Words find the most telling part of an object; vectors of the object mask know what belongs to it.
Axes: ``h w`` pixels, ``p`` all of them, ``s`` cells of two pixels, ``k`` channels.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.object_mask.instance_vectors import pair_logits

CELL_PX = 2
SHARPNESS = 2
"""Power of membership: what may belong to an object counts less than what surely does."""
MEAN_WEIGHT = 0.4
"""Of the mean over the object's pixels, against the pixel's own probability."""
LOW_SHARE = 0.35
"""Of the highest probability, above which a pixel moves: what is of the object alone has 0.4. All
chosen on validation worlds (docs/log/object-mask-backbone.md)."""
CHUNK = 4096
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
    return highest * torch.lerp(probability / highest, means / means.max(), MEAN_WEIGHT)


def _mean_over_object(
    probability: Float[Tensor, "h w"], instances: Float[Tensor, "k h w"]
) -> Float[Tensor, "h w"]:
    cells = torch.nn.functional.avg_pool2d(
        torch.cat([instances, probability[None]])[None], CELL_PX, ceil_mode=True
    )[0].flatten(1)
    vectors, log_scales, values = cells[:-2].mT, cells[-2], cells[-1]
    of_pixels = instances[:-1].flatten(1).mT
    means = []
    for part in of_pixels.split(CHUNK):
        membership = pair_logits(part, vectors, log_scales).sigmoid() ** SHARPNESS
        means.append(membership @ values / membership.sum(1).clamp_min(1e-6))
    return torch.cat(means).view_as(probability)
