"""Polar coordinates on the image plane and around the optical axis, without bad gradients.

A point at radius r from the centre and the direction at angle θ from the axis share their azimuth:
(x, y) / r = (X, Y) / sin θ. Both quotients are smooth at the centre, but not as written; here they
have their limit there, in value and in gradient.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

LARGEST_TANGENT = 1e6
"""Directions closer than this to a right angle with the axis have no point on a flat image."""

TINY = 1e-18
"""Radii and sines below count as zero."""

SHORTEST = 1e-30
"""Directions shorter than this have no orientation."""

BACKWARD = 1e-6
"""Angle in radians about the backward axis, where the azimuth is lost."""


def finite_points(
    points: Float[Tensor, "*b 2"],
) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
    """The points with the origin in place of any that is not finite, and which are."""
    finite = torch.isfinite(points).all(-1)
    return torch.where(finite[..., None], points, torch.zeros_like(points)), finite


def unit_directions(
    directions: Float[Tensor, "*b 3"],
) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
    """Directions at length one, the forward axis in place of those without one, and which have."""
    size = directions.detach().abs().amax(-1)
    exists = torch.isfinite(size) & (size > SHORTEST)
    safe = torch.where(exists[..., None], directions, forward(directions))
    # The largest entry first, so that no square over- or underflows.
    safe = safe / torch.where(exists, size, torch.ones_like(size))[..., None]
    return safe / torch.linalg.vector_norm(safe, dim=-1, keepdim=True), exists


def length(vectors: Float[Tensor, "*b 2"]) -> Float[Tensor, "*b"]:
    """Euclidean length; the gradient at zero is zero."""
    zero = (vectors == 0).all(-1)
    safe = torch.where(zero[..., None], torch.ones_like(vectors), vectors)
    lengths = torch.hypot(safe[..., 0], safe[..., 1])
    return torch.where(zero, torch.zeros_like(lengths), lengths)


def angle_from_axis(unit: Float[Tensor, "*b 3"]) -> tuple[Float[Tensor, "*b"], Bool[Tensor, "*b"]]:
    """θ in [0, π], and where the direction has an azimuth or lies on the forward axis."""
    sine = length(unit[..., :2])
    exists = (unit[..., 2] > 0) | (sine.detach() > BACKWARD)
    safe_z = torch.where(exists, unit[..., 2], torch.ones_like(sine))
    return torch.atan2(sine, safe_z), exists


def quotient(
    top: Float[Tensor, "*b"], bottom: Float[Tensor, "*b"], at_zero: Float[Tensor, ""]
) -> Float[Tensor, "*b"]:
    """``top / bottom``, with its limit where the bottom vanishes."""
    vanishes = bottom.detach() <= TINY
    ratio = top / torch.where(vanishes, torch.ones_like(bottom), bottom)
    return torch.where(vanishes, at_zero.to(ratio.dtype), ratio)


def directions_around(
    points: Float[Tensor, "*b 2"],
    angle: Float[Tensor, "*b"],
    centre_slope: Float[Tensor, ""],
    exists: Bool[Tensor, "*b"],
) -> Float[Tensor, "*b 3"]:
    """Unit directions at ``angle`` from the axis and the azimuth of ``points``.

    ``centre_slope`` is d angle / d radius at the centre.
    """
    scale = quotient(angle.sin(), length(points), centre_slope)
    directions = torch.cat([points * scale[..., None], angle.cos()[..., None]], -1)
    return torch.where(exists[..., None], directions, forward(directions))


def points_around(
    unit: Float[Tensor, "*b 3"],
    radius: Float[Tensor, "*b"],
    centre_slope: Float[Tensor, ""],
    exists: Bool[Tensor, "*b"],
) -> Float[Tensor, "*b 2"]:
    """Points at ``radius`` from the centre and the azimuth of unit directions.

    ``centre_slope`` is d radius / d angle at the centre.
    """
    scale = quotient(radius, length(unit[..., :2]), centre_slope)
    points = unit[..., :2] * scale[..., None]
    return torch.where(exists[..., None], points, torch.zeros_like(points))


def forward(like: Float[Tensor, "*b 3"]) -> Float[Tensor, "3"]:
    """The optical axis (0, 0, 1) in the dtype and on the device of ``like``."""
    return like.new_tensor([0.0, 0.0, 1.0])
