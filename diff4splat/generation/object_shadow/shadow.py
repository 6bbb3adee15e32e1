"""The shadow of one moving object, and the image without it.

Axes: ``h w`` pixels of the image, ``t`` latent frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage, downsample


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectShadow:
    """What an object takes from the light of the image's pixels, and how the object moves."""

    darkening: Float[Tensor, "h w 3"]
    """Logarithm of a pixel's colour without the object over that with it; 0 outside the shadow.

    Of pixels that the object itself covers: what they would have if they were ground.
    """
    displacement: Float[Tensor, "t 3"]
    """Of the object, in scene units, along the first camera's axes."""


def without_shadows(image: InputImage, shadows: Sequence[ObjectShadow]) -> InputImage:
    """The image as it would be lit if these objects were not there."""
    if not shadows:
        return image
    darkening = sum(one.darkening for one in shadows)
    return replace(image, rgb=(image.rgb * darkening.exp()).clamp(0, 1))


def reduced_like(copy: InputImage, image: InputImage) -> InputImage:
    """``copy`` with the colours of ``image``, of which it is a smaller copy."""
    return replace(copy, rgb=downsample(image, len(image.rgb) // len(copy.rgb)).rgb)
