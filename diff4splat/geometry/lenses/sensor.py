"""Pixels of a camera with a lens to directions in camera axes, and back.

Pixel (row i, column j) has its centre at (x, y) = (j + 0.5, i + 0.5).
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.lenses.protocol import Lens


def sensor_directions(
    camera: Camera, lens: Lens, pixels: Float[Tensor, "*b 2"]
) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
    """Unit directions in camera axes seen at pixel coordinates (x, y), and which exist.

    Raises:
        ShapeError: ``camera`` is a batch.
    """
    _check_single(camera)
    return lens.directions((pixels - camera.center_px) / camera.focal_px)


def sensor_pixels(
    camera: Camera, lens: Lens, directions: Float[Tensor, "*b 3"]
) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
    """Pixel coordinates (x, y) of directions in camera axes, and which exist.

    Pixels outside the image exist too; where there is none, the value is the centre.

    Raises:
        ShapeError: ``camera`` is a batch.
    """
    _check_single(camera)
    points, exists = lens.points(directions)
    pixels = points * camera.focal_px + camera.center_px
    return torch.where(exists[..., None], pixels, camera.center_px.detach()), exists


def _check_single(camera: Camera) -> None:
    if camera.batch_shape != ():
        raise ShapeError(
            f"camera: expected one camera, got a batch of {camera.batch_shape}; index it first"
        )
