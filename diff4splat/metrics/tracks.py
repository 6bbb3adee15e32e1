"""How far tracked motion is from the true one.

Axes: ``*b`` sets of points, ``n`` points, ``d`` = 2 (pixels) or 3 (scene units). Points that are
not ``valid`` do not count and may hold NaN; a set to which a question does not apply is NaN: leave
it out of means with ``nanmean``.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike, require_mask
from diff4splat.metrics.masked import mean_or_nan, zero_masked


def track_endpoint_error(
    predicted: Float[Tensor, "*b n d"],
    truth: Float[Tensor, "*b n d"],
    valid: Bool[Tensor, "*b n"],
) -> Float[Tensor, "*b"]:
    """Mean distance between predicted and true points, or displacements, in their own unit.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("predicted", predicted, truth)
    require_mask(valid, truth.shape[:-1])
    predicted, truth = (zero_masked(part, valid[..., None]) for part in promote(predicted, truth))
    apart = torch.linalg.vector_norm(predicted - truth, dim=-1)
    return mean_or_nan(apart, valid)
