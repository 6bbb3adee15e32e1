"""The shadow of one moving object, and the image without it.

Axes: ``h w`` pixels of the image, ``y x`` of a copy, ``t`` latent frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import interpolate


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectShadow:
    """What an object takes from the light of the image's pixels, and how the object moves."""

    darkening: Float[Tensor, "h w 3"]
    """Logarithm of a pixel's colour without the object over that with it; 0 outside the shadow.

    Of pixels that the object itself covers: what they would have if they were ground.
    """
    displacement: Float[Tensor, "t 3"]
    """Of the object, in scene units, along the first camera's axes."""


def without_shadows(
    rgb: Float[Tensor, "y x 3"], shadows: Sequence[ObjectShadow]
) -> Float[Tensor, "y x 3"]:
    """The image, or a copy of it, as it would be lit if these objects were not there."""
    if not shadows:
        return rgb
    darkening = sum(one.darkening for one in shadows).movedim(-1, 0)[None]
    if darkening.shape[2:] != rgb.shape[:2]:
        darkening = interpolate(darkening, tuple(rgb.shape[:2]), mode="area")
    return (rgb * darkening[0].movedim(0, -1).exp()).clamp(0, 1)
