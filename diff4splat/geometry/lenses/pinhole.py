"""The ideal lens: points are (x/z, y/z)."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.lenses.polar import (
    LARGEST_TANGENT,
    finite_points,
    forward,
    length,
    unit_directions,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinhole:
    """No distortion; image-plane coordinates are tangents.

    Points beyond ``LARGEST_TANGENT`` count as lying at a right angle with the axis: they do not
    exist.
    """

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions (x, y, 1) / |(x, y, 1)|, and which exist."""
        points, exists = finite_points(points)
        exists = exists & (length(points.detach()) <= LARGEST_TANGENT)
        return tangent_directions(points, exists), exists

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """Points (x/z, y/z); directions with z <= 0 have none."""
        unit, exists = unit_directions(directions)
        points, in_front = tangents(unit)
        return points, exists & in_front

    def to(self, target: torch.device | torch.dtype) -> "Pinhole":
        """Itself: there is no tensor to move."""
        return self


def tangents(
    unit: Float[Tensor, "*b 3"],
) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
    """(x/z, y/z) of unit directions, and where z is positive enough; (0, 0) elsewhere."""
    exists = unit[..., 2].detach() * LARGEST_TANGENT >= 1
    safe = torch.where(exists[..., None], unit, forward(unit))
    return safe[..., :2] / safe[..., 2:], exists


def tangent_directions(
    points: Float[Tensor, "*b 2"], exists: Bool[Tensor, "*b"]
) -> Float[Tensor, "*b 3"]:
    """Unit directions through points on the plane z = 1; the axis where there is none."""
    safe = torch.where(exists[..., None], points, torch.zeros_like(points))
    through = torch.cat([safe, torch.ones_like(safe[..., :1])], -1)
    return through / torch.linalg.vector_norm(through, dim=-1, keepdim=True)
