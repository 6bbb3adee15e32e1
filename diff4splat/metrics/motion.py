"""How far a motion is from another one.

Axes: ``*b`` images, ``h w`` pixels, 2 for (x, y) in pixels.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError


def endpoint_error(
    flow: Float[Tensor, "*b h w 2"],
    reference: Float[Tensor, "*b h w 2"],
    valid: Bool[Tensor, "*b h w"] | None = None,
) -> Float[Tensor, "*b"]:
    """Mean distance of the end points of two flows over the ``valid`` pixels, in pixels.

    Raises:
        ShapeError: the shapes differ.
        InputError: an image has no valid pixel.
    """
    if flow.shape != reference.shape:
        raise ShapeError(f"flow: expected {tuple(reference.shape)}, got {tuple(flow.shape)}")
    if valid is None:
        valid = torch.ones_like(flow[..., 0], dtype=torch.bool)
    if valid.shape != flow.shape[:-1]:
        raise ShapeError(f"valid: expected {tuple(flow.shape[:-1])}, got {tuple(valid.shape)}")
    count = valid.sum((-2, -1))
    if bool((count == 0).any()):
        raise InputError("endpoint_error: expected a valid pixel in every image, got none")
    # Masked first: what stands in invalid pixels may be NaN.
    apart = torch.where(valid[..., None], flow - reference, 0.0)
    return torch.linalg.vector_norm(apart, dim=-1).sum((-2, -1)) / count
