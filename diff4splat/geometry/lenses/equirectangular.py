"""The whole sphere on one image: points are (longitude, latitude) in radians.

    direction = (sin lon cos lat, sin lat, cos lon cos lat)

x to the right, y downwards, so that a positive latitude lies below the horizon. The camera's focal
length is (width / 2π, height / π) pixels per radian; see ``build.equirectangular_camera``.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.lenses import polar

ROUNDING = 1e-6
"""How far beyond ±π and ±π/2 a point may lie: what float32 makes of the edge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Equirectangular:
    """Longitude and latitude; every direction has a point. The poles get longitude 0."""

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions at (longitude, latitude), and which exist."""
        points, exists = polar.finite_points(points)
        size = points.detach().abs()
        exists = exists & (size[..., 0] <= math.pi + ROUNDING)
        exists = exists & (size[..., 1] <= math.pi / 2 + ROUNDING)
        longitude, latitude = points.unbind(-1)
        level = latitude.cos()
        directions = torch.stack(
            [longitude.sin() * level, latitude.sin(), longitude.cos() * level], -1
        )
        return torch.where(exists[..., None], directions, polar.forward(directions)), exists

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """(longitude, latitude) of directions, and which are directions at all."""
        unit, exists = polar.unit_directions(directions)
        level = polar.length(unit[..., ::2])
        pole = level.detach() <= polar.TINY
        # At the poles atan2(0, 0) has no gradient.
        safe = torch.where(pole[..., None], polar.forward(unit), unit)
        longitude = torch.atan2(safe[..., 0], safe[..., 2])
        latitude = torch.atan2(unit[..., 1], level)
        points = torch.stack([longitude, latitude], -1)
        return torch.where(exists[..., None], points, torch.zeros_like(points)), exists

    def to(self, target: torch.device | torch.dtype) -> "Equirectangular":
        """Itself: there is no tensor to move."""
        return self
