"""What the priors say about an image, on the copies of it that they see.

Axes: ``h w`` pixels of a copy, ``t`` latent frames.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.local_motion.moving_object import MovingObjects
from diff4splat.generation.object_shadow.shadow import ObjectShadow


@dataclass(frozen=True, slots=True, kw_only=True)
class FineMaps:
    """Maps of a copy of an image that is larger than the one other networks see."""

    rgb: Float[Tensor, "h w 3"]
    depth: Float[Tensor, "h w"]
    smooth: bool = True
    """Whether cells of a prediction have to be smoothed away; not of depth that was given."""
    displacement: Float[Tensor, "t h w 3"] | None = None
    """None takes that of the smaller copy."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageMaps:
    """What the priors say about the smaller copy of an image."""

    depth: Float[Tensor, "h w"]
    """z in scene units."""
    displacement: Float[Tensor, "t h w 3"] | None
    """From the first frame, in scene units, at the times of the latent frames; None is static."""
    fine: FineMaps | None = None
    """The same of a larger copy, for the image's own pixels."""
    objects: MovingObjects | None = None
    """What moves about itself; None where nothing does."""
    shadows: tuple[ObjectShadow, ...] = ()
    """Of what moves, at the size of the image."""


def is_reduced(small: InputImage, image: InputImage) -> bool:
    """Whether networks see less than the image's pixels."""
    return small.camera.size_px != image.camera.size_px


def finest_copy(small: InputImage, maps: ImageMaps) -> Float[Tensor, "h w 3"]:
    """The largest copy that depth belongs to."""
    return small.rgb if maps.fine is None else maps.fine.rgb
