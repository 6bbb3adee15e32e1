"""Blender's fisheye lens polynomial: the angle from the axis as a polynomial of millimetres.

    θ = k_0 + k_1 r + k_2 r² + k_3 r³ + k_4 r⁴,   r = √(x² + y²) in mm on the sensor
    direction = (sin θ cos φ, sin θ sin φ, cos θ),   φ = atan2(y, x)

Blender's Cycles has the opposite sign, θ = -(k_0 + k_1 r + …), with negative coefficients. Beyond
half the field of view there is no ray. The camera's focal length is pixels per millimetre; see
``build.blender_camera``.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry.lenses import polar
from diff4splat.geometry.lenses.checks import check_angle, check_coefficients
from diff4splat.geometry.lenses.polynomial import RisingCurve, first_positive_root, rising_limit

BLENDER_DEFAULT = tuple(math.radians(degrees) for degrees in (0.0, 1.0, 0.03, 0.001, 0.0))
"""k_0 … k_4 in rad / mm^i of the lens in 4D-GRT (arXiv 2509.10759)."""

FARTHEST_MM = 1e6
"""In place of infinity where the polynomial never reaches half the field of view."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlenderFisheye:
    """A fisheye lens as Blender describes it; image-plane coordinates are millimetres.

    With k_0 ≠ 0 the centre of the image and the axis have no partner, since their azimuth is
    unknown. With k_0 < 0 a direction can be seen twice; ``points`` gives the side where θ >= 0.

    Raises:
        ShapeError: not five floating-point coefficients.
        InputError: coefficients that are not finite or fall at the centre, or an angle outside
            (0, 2π].
    """

    coefficients: Float[Tensor, "5"]
    """(k_0, …, k_4) in rad / mm^i"""
    fov_rad: float = math.pi
    """Full field of view."""
    cycles_signs: bool = False
    """θ = -(k_0 + k_1 r + …), as in Cycles."""

    def __post_init__(self) -> None:
        check_coefficients("BlenderFisheye.coefficients", self.coefficients, 5)
        check_angle("BlenderFisheye.fov_rad", self.fov_rad)
        slope = float(self.coefficients[1].detach())
        wanted, other = ("negative", False) if self.cycles_signs else ("positive", True)
        if not (-slope if self.cycles_signs else slope) > 0:
            raise InputError(
                f"BlenderFisheye.coefficients: expected a {wanted} k_1 with "
                f"cycles_signs={self.cycles_signs}, got {slope}; negate all or set "
                f"cycles_signs={other}"
            )

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions seen at points of the sensor, and which exist."""
        points, finite = polar.finite_points(points)
        curve, radius = self._curve(), polar.length(points)
        angle, exists = curve.value(radius)
        exists = exists & finite & self._seen(angle, radius)
        return polar.directions_around(points, angle, curve.coefficients[1], exists), exists

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """Where directions fall on the sensor, and which do."""
        unit, oriented = polar.unit_directions(directions)
        angle, has_azimuth = polar.angle_from_axis(unit)
        curve = self._curve()
        radius, exists = curve.inverse(angle)
        exists = exists & oriented & has_azimuth & self._seen(angle, polar.length(unit[..., :2]))
        return polar.points_around(unit, radius, 1 / curve.coefficients[1], exists), exists

    def to(self, target: torch.device | torch.dtype) -> "BlenderFisheye":
        """Move or cast the coefficients."""
        return replace(self, coefficients=self.coefficients.to(target))

    def _curve(self) -> RisingCurve:
        polynomial = -self.coefficients if self.cycles_signs else self.coefficients
        edge = polynomial.detach().double().tolist()
        edge[0] -= self.fov_rad / 2
        upper = min(first_positive_root(edge), rising_limit(polynomial), FARTHEST_MM)
        return RisingCurve(polynomial, upper)

    def _seen(self, angle: Tensor, off_axis: Tensor) -> Tensor:
        """Within half the field of view, and with an azimuth unless k_0 = 0 makes it needless."""
        within = angle.detach().abs() <= self.fov_rad / 2
        return within & ((off_axis.detach() > polar.TINY) | (self.coefficients[0].detach() == 0))
