"""Lenses without undistortion: fisheye and equirectangular images, which exceed a pinhole.

A fisheye is OpenCV's, θ_d = θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸), in COLMAP's and nerfstudio's
files alike; COLMAP's radial ones are those with the last coefficients 0
(https://colmap.github.io/cameras.html). All cameras of a capture share the lens; focal lengths and
centres may differ per frame.
"""

from collections.abc import Sequence

import torch

from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.errors import FileFormatError
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Optics
from diff4splat.io.cameras.lens_json import as_file_error

_SMALLEST_CIRCLE = 0.5
"""Diameter of what a fisheye sees, in shorter sides of the image; real ones fill more."""
_ALMOST = 0.999
"""Share of the range up to the turning point of the polynomial that is used."""

LENS_NOTES = {
    "fisheye": (
        "images were left as their fisheye lens shows them: fits see them through it by rays, "
        "which is slower"
    ),
    "equirectangular": (
        "images were left as they are, the whole sphere around the camera: fits see them by "
        "rays, which is slower"
    ),
}
"""What is said of a capture, by the model of its lens."""


def require_fisheye(lens: Intrinsics, where: str) -> Intrinsics:
    """Return ``lens`` if it is a valid fisheye.

    Raises:
        FileFormatError: coefficients are not finite, or the polynomial turns back so early that
            next to nothing of the image would be seen.
    """
    with as_file_error(where):
        fisheye = _fisheye(lens)
    largest_rad = torch.tensor(_ALMOST * fisheye.largest_angle_rad, dtype=torch.float64)
    radius_px = float(fisheye.radii(largest_rad)[0]) * min(lens.focal_px)
    if min(lens.focal_px) > 0 and 2 * radius_px < _SMALLEST_CIRCLE * min(lens.size_px):
        raise FileFormatError(
            f"{where}: expected fisheye coefficients that rise over the image, got "
            f"{_numbers(lens)}, which turn back {radius_px:.3g} pixels from the centre; calibrate "
            "the lens again"
        )
    return lens


def require_shared_optics(shots: Sequence[Shot]) -> Optics | None:
    """The lens that all shots share; None for pinhole images.

    Raises:
        FileFormatError: two of them differ; names both.
    """
    first = shots[0]
    for shot in shots[1:]:
        _require_same(first, shot)
    if not first.lens.keeps_projection:
        return None
    if first.lens.model == "equirectangular":
        return Optics(lens=Equirectangular())
    return Optics(lens=_fisheye(first.lens))


def _fisheye(lens: Intrinsics) -> OpenCVFisheye:
    return OpenCVFisheye(coefficients=torch.tensor(lens.fisheye, dtype=torch.float64))


def _require_same(first: Shot, other: Shot) -> None:
    mine, theirs = first.lens, other.lens
    if mine.model != theirs.model:
        raise FileFormatError(
            f"{other.image.where}: expected a {mine.model} camera as for {first.image.where}, "
            f"since cameras of one capture share their lens, got a {theirs.model} one; straighten "
            "the images of the others, or leave one kind out"
        )
    if mine.fisheye != theirs.fisheye:
        raise FileFormatError(
            f"{other.image.where}: expected the fisheye coefficients of {first.image.where}, "
            f"{_numbers(mine)}, since cameras of one capture share their lens, got "
            f"{_numbers(theirs)}; calibrate them as one camera, or straighten the images"
        )


def _numbers(lens: Intrinsics) -> str:
    return "(" + ", ".join(f"{value:.17g}" for value in lens.fisheye) + ")"
