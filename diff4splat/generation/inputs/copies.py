"""The sizes in which networks see an image."""

from dataclasses import dataclass

from diff4splat.generation.given_depth.source import DepthSource
from diff4splat.generation.inputs.input_image import InputImage, downsample, enlarged


@dataclass(frozen=True, slots=True, kw_only=True)
class Copies:
    """An image, and the smaller copy of it that networks see."""

    image: InputImage
    small: InputImage
    depth: DepthSource | None = None
    """Depth of the image that takes the place of the model's own prior."""


def larger_copy(images: Copies, scale: int) -> InputImage:
    """The copy with ``scale`` times the small side, where the photograph is reduced so far."""
    reduction = images.small.reduction
    if scale == 1 or reduction % scale:
        return images.small
    return downsample(images.image, reduction // scale)


def motion_copy(images: Copies, scale: int) -> InputImage:
    """The copy with ``scale`` times the small side: of the photograph's pixels, or enlarged."""
    larger = larger_copy(images, scale)
    return larger if scale == 1 or larger is not images.small else enlarged(larger, scale)
