"""OpenCV's pinhole lens with distortion: rational radial, tangential and thin-prism terms.

With x = X/Z, y = Y/Z and u = x² + y²:

    f = (1 + k_1 u + k_2 u² + k_3 u³) / (1 + k_4 u + k_5 u² + k_6 u³)
    x_d = x f + 2 p_1 x y + p_2 (u + 2 x²) + s_1 u + s_2 u²
    y_d = y f + p_1 (u + 2 y²) + 2 p_2 x y + s_3 u + s_4 u²

(OpenCV, calib3d; without the tilted sensor.) The lens ends where √u f turns back or has a pole, and
where the whole mapping folds: there its Jacobian is no longer positive.
"""

from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.lenses import distortion
from diff4splat.geometry.lenses.checks import check_coefficients
from diff4splat.geometry.lenses.pinhole import tangent_directions, tangents
from diff4splat.geometry.lenses.polar import finite_points, unit_directions


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenCVPinhole:
    """A calibrated lens of moderate field of view; image-plane coordinates are (x_d, y_d).

    Raises:
        ShapeError: another number of coefficients, or not floating-point.
        InputError: coefficients that are not finite.
    """

    radial: Float[Tensor, "6"] = field(default_factory=lambda: torch.zeros(6))
    """(k_1, …, k_6); mind that OpenCV puts p_1 and p_2 after k_2"""
    tangential: Float[Tensor, "2"] = field(default_factory=lambda: torch.zeros(2))
    """(p_1, p_2)"""
    thin_prism: Float[Tensor, "4"] = field(default_factory=lambda: torch.zeros(4))
    """(s_1, …, s_4)"""

    def __post_init__(self) -> None:
        check_coefficients("OpenCVPinhole.radial", self.radial, 6)
        check_coefficients("OpenCVPinhole.tangential", self.tangential, 2)
        check_coefficients("OpenCVPinhole.thin_prism", self.thin_prism, 4)

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions seen at distorted points, and which exist."""
        points, finite = finite_points(points)
        ideal, exists = distortion.undistort(self._terms(), points)
        exists = exists & finite
        return tangent_directions(ideal, exists), exists

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """Distorted points of directions, and which lie within the lens."""
        unit, oriented = unit_directions(directions)
        ideal, in_front = tangents(unit)
        terms = self._terms()
        exists = oriented & in_front & distortion.inside(terms, ideal.detach().double())
        safe = torch.where(exists[..., None], ideal, torch.zeros_like(ideal))
        return distortion.distort(terms, safe), exists

    def to(self, target: torch.device | torch.dtype) -> "OpenCVPinhole":
        """Move or cast the coefficients."""
        return replace(
            self,
            radial=self.radial.to(target),
            tangential=self.tangential.to(target),
            thin_prism=self.thin_prism.to(target),
        )

    def _terms(self) -> distortion.Distortion:
        return distortion.Distortion(self.radial, self.tangential, self.thin_prism)
