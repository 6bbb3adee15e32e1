"""Intrinsics as stored in files: pinhole, skew and distortion.

With (x, y) = (X/Z, Y/Z) in OpenCV camera axes and r² = x² + y², a point projects to

    x' = x (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) + 2 p₁ x y + p₂ (r² + 2 x²)     u = f_x x' + s y' + c_x
    y' = y (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) + p₁ (r² + 2 y²) + 2 p₂ x y     v = f_y y' + c_y

(OpenCV, calib3d; COLMAP's and Nerfies' cameras are the same). Pixel centres are at +0.5. Fisheye
and equirectangular lenses: see ``fisheye_lenses``.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from diff4splat.errors import FileFormatError

_ROUNDING_PX = 1.5
"""What halving an image may do to its sides."""
_OUTSIDE = -2.0
_LARGEST = 1e12
"""Of any number of a camera; powers of larger ones leave float64."""
_FARTHEST_PX = 1e6
"""Outside any image, and inside what OpenCV's remap can hold."""
MAX_SIDE_PX = 100_000
"""Of an image; larger sizes are damage."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Intrinsics in pixels of an image of ``size_px``."""

    focal_px: tuple[float, float]
    center_px: tuple[float, float]
    size_px: tuple[int, int]
    """(height, width)"""
    skew_px: float = 0.0
    radial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """k₁, k₂, k₃"""
    tangential: tuple[float, float] = (0.0, 0.0)
    """p₁, p₂"""
    model: Literal["pinhole", "fisheye", "equirectangular"] = "pinhole"
    """Focal lengths of the last two are pixels per radian."""
    fisheye: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """k₁, k₂, k₃, k₄ of the polynomial of the angle."""

    @property
    def keeps_projection(self) -> bool:
        """Whether images keep their projection instead of becoming pinhole images."""
        return self.model != "pinhole"

    @property
    def is_distorted(self) -> bool:
        """Whether images need undistortion."""
        return not self.keeps_projection and any((self.skew_px, *self.radial, *self.tangential))

    def scaled_to(self, size_px: tuple[int, int], where: str) -> "Intrinsics":
        """The intrinsics for an image of another size and the same aspect ratio.

        Raises:
            FileFormatError: the shape differs by more than rounding to whole pixels.
        """
        (height, width), (new_height, new_width) = self.size_px, size_px
        if max(height, width) > MAX_SIDE_PX:
            raise FileFormatError(
                f"{where}: expected a camera of up to {MAX_SIDE_PX} pixels per side, got more; "
                "repair its size"
            )
        if not self._is_bounded():
            raise FileFormatError(
                f"{where}: expected sides of 1 pixel or more, focal lengths above 0 and numbers "
                f"up to {_LARGEST:.0e}, got others; calibrate the camera again"
            )
        across, along = new_width / width, new_height / height
        if abs(height * across - new_height) > _ROUNDING_PX:
            raise FileFormatError(
                f"{where}: expected an image shaped as its camera, {width} x {height}, got "
                f"{new_width} x {new_height}; give the images that the cameras were made for"
            )
        return replace(
            self,
            focal_px=(self.focal_px[0] * across, self.focal_px[1] * along),
            center_px=(self.center_px[0] * across, self.center_px[1] * along),
            skew_px=self.skew_px * across,
            size_px=size_px,
        )

    def _is_bounded(self) -> bool:
        if min(self.size_px) < 1:
            return False
        numbers = (*self.center_px, self.skew_px, *self.radial, *self.tangential, *self.fisheye)
        small = all(abs(number) <= _LARGEST for number in numbers)
        return small and all(0 < focal <= _LARGEST for focal in self.focal_px)

    def downscaled(self, factor: int) -> "Intrinsics":
        """The intrinsics for images downscaled by ``factor``."""
        return replace(
            self,
            focal_px=(self.focal_px[0] / factor, self.focal_px[1] / factor),
            center_px=(self.center_px[0] / factor, self.center_px[1] / factor),
            skew_px=self.skew_px / factor,
            size_px=(self.size_px[0] // factor, self.size_px[1] // factor),
        )


def distort(
    lens: Intrinsics, x: Float[np.ndarray, "*b"], y: Float[np.ndarray, "*b"]
) -> tuple[Float[np.ndarray, "*b"], Float[np.ndarray, "*b"]]:
    """Pixel coordinates of the directions (x, y, 1)."""
    (k1, k2, k3), (p1, p2) = lens.radial, lens.tangential
    squared = x * x + y * y
    stretch = 1 + squared * (k1 + squared * (k2 + squared * k3))
    bent_x = x * stretch + 2 * p1 * x * y + p2 * (squared + 2 * x * x)
    bent_y = y * stretch + p1 * (squared + 2 * y * y) + 2 * p2 * x * y
    column = lens.focal_px[0] * bent_x + lens.skew_px * bent_y + lens.center_px[0]
    return column, lens.focal_px[1] * bent_y + lens.center_px[1]


def undistortion_map(lens: Intrinsics) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """Where a pinhole camera of the same focal lengths finds its pixels in the distorted image.

    (column, row) as OpenCV's ``remap`` wants them: float32, pixel centres at whole numbers. Where
    the formula bends back on itself there is nothing to find, and both lie outside the image.
    """
    height, width = lens.size_px
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x = (column - lens.center_px[0]) / lens.focal_px[0]
    y = (row - lens.center_px[1]) / lens.focal_px[1]
    # Strong distortion far outside the image leaves any range; such pixels have no source.
    with np.errstate(over="ignore", invalid="ignore"):
        across, down = distort(lens, x, y)
        seen = x * x + y * y < _turning_point(lens)
        seen &= (np.abs(across) < _FARTHEST_PX) & (np.abs(down) < _FARTHEST_PX)
    across, down = (np.where(seen, source - 0.5, _OUTSIDE) for source in (across, down))
    return across.astype(np.float32), down.astype(np.float32)


def _turning_point(lens: Intrinsics) -> float:
    """The r² at which r (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) grows no more."""
    k1, k2, k3 = lens.radial
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    real = roots[np.isreal(roots)].real
    return float(min(real[real > 0], default=np.inf))
