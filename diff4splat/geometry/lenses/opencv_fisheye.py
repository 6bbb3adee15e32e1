"""OpenCV's fisheye lens (Kannala and Brandt 2006): a polynomial of the angle from the axis.

    θ_d = θ (1 + k_1 θ² + k_2 θ⁴ + k_3 θ⁶ + k_4 θ⁸),   point = θ_d (X, Y) / √(X² + Y²)

with θ = atan2(√(X² + Y²), Z): directions behind the camera (θ > 90°) are as good as others. The
polynomial means nothing where it turns back, nor beyond the cone that was calibrated.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.lenses import polar
from diff4splat.geometry.lenses.checks import check_angle, check_coefficients
from diff4splat.geometry.lenses.polynomial import RisingCurve, rising_limit


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenCVFisheye:
    """A calibrated fisheye lens; image-plane coordinates have length θ_d.

    Raises:
        ShapeError: not four floating-point coefficients.
        InputError: coefficients that are not finite, or an angle outside (0, 2π].
    """

    coefficients: Float[Tensor, "4"]
    """(k_1, k_2, k_3, k_4)"""
    max_angle_rad: float | None = None
    """Largest θ that was calibrated: half the field of view. None: as far as the lens goes."""

    def __post_init__(self) -> None:
        check_coefficients("OpenCVFisheye.coefficients", self.coefficients, 4)
        if self.max_angle_rad is not None:
            check_angle("OpenCVFisheye.max_angle_rad", self.max_angle_rad)

    @property
    def largest_angle_rad(self) -> float:
        """Where the lens ends: the given angle, the polynomial's turning point, or π."""
        return self._curve().upper

    def radii(self, angles: Float[Tensor, "*b"]) -> tuple[Float[Tensor, "*b"], Bool[Tensor, "*b"]]:
        """θ_d at angles from the axis in radians, and where it exists (0 elsewhere)."""
        return self._curve().value(angles)

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions seen at points, and which exist."""
        points, finite = polar.finite_points(points)
        curve = self._curve()
        angle, exists = curve.inverse(polar.length(points))
        exists = exists & finite
        return polar.directions_around(points, angle, 1 / curve.coefficients[1], exists), exists

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """Points θ_d (X, Y) / √(X² + Y²), and which lie in the cone of the lens."""
        unit, oriented = polar.unit_directions(directions)
        angle, has_azimuth = polar.angle_from_axis(unit)
        curve = self._curve()
        radius, exists = curve.value(angle)
        exists = exists & oriented & has_azimuth
        return polar.points_around(unit, radius, curve.coefficients[1], exists), exists

    def to(self, target: torch.device | torch.dtype) -> "OpenCVFisheye":
        """Move or cast the coefficients."""
        return replace(self, coefficients=self.coefficients.to(target))

    def _curve(self) -> RisingCurve:
        zero, one = self.coefficients.new_tensor([0.0, 1.0])
        terms = [zero, one]
        for coefficient in self.coefficients:
            terms += [zero, coefficient]
        polynomial = torch.stack(terms)
        largest = math.pi if self.max_angle_rad is None else min(self.max_angle_rad, math.pi)
        return RisingCurve(polynomial, min(largest, rising_limit(polynomial)))
