"""Perceptual distance of images in the layout of renders and files.

Axes: ``*b`` images, ``h w`` pixels. RGB in [0, 1].
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.metrics.checks import promote, require_alike
from diff4splat.metrics.features.protocol import PerceptualFeatures


def perceptual_distance(
    image: Float[Tensor, "*b h w 3"],
    reference: Float[Tensor, "*b h w 3"],
    features: PerceptualFeatures,
) -> Float[Tensor, "*b"]:
    """Distance of each image under ``features``; say ``features.name`` wherever it is shown.

    Raises:
        ShapeError: the shapes differ, or there is no pixel.
    """
    require_alike("image", image, reference)
    if image.ndim < 3 or 0 in image.shape[-3:]:
        raise ShapeError(f"image: expected h w 3 with a pixel, got {tuple(image.shape)}")
    batch, size = image.shape[:-3], image.shape[-3:]
    image, reference = (
        side.reshape(batch.numel(), *size).movedim(-1, 1) for side in promote(image, reference)
    )
    return features.distance(image, reference).reshape(batch)
