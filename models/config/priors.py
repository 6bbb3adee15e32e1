"""Settings of the priors: networks that take one image and no video."""

from dataclasses import dataclass
from typing import Literal, get_args

from diff4splat.models.config.checks import require, require_counts, require_optional_width

BACKBONE_MULTIPLE_PX = 32
"""Image sides that the image backbone takes are multiples of it."""
BackboneSize = Literal["lite0", "lite2"]
"""Of EfficientNet-Lite: with the larger one the depth prior has 6.7 million weights, else 5.3, the
object mask 5.3 million, else 4.8."""
MAX_LEVELS, MAX_WIDTH = 10, 1 << 14
"""Of image inpainting; more is damage."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonocularDepthConfig:
    """Depth prior: a U-Net from one image to the depth of its pixels (ours, ADR 23)."""

    channels: int = 0
    """At half the resolution; 0 leaves the prior out: the image is a plane."""
    photo_scale: int = 1
    """Sides of the copy of a photograph that it sees, against the copy of the other networks."""
    image_backbone: bool = False
    """Whether it also decodes features of the image backbone (ADR 32)."""
    backbone_size: BackboneSize = "lite0"
    """Of the image backbone."""
    uncertainty: bool = False
    """Whether it also says how far off it may be; needs the image backbone (ADR 39)."""

    def __post_init__(self) -> None:
        require_optional_width(self, "channels")
        require_counts(self, "photo_scale")
        _require_backbone_fits(self)
        fits = self.image_backbone or not self.uncertainty
        where = "MonocularDepthConfig.uncertainty"
        require(fits, where, "false without the image backbone", self.uncertainty)

    @property
    def used(self) -> bool:
        """Whether there is such a network."""
        return self.channels > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMaskConfig:
    """Object mask: a U-Net from one image to the pixels that a prompt asks to move (ADR 29)."""

    width: int = 0
    """Channels at half the resolution; 0 leaves it out: the motion prior's own mask decides."""
    image_backbone: bool = False
    """Whether it has a second encoder, the image backbone (ADR 32)."""
    backbone_size: BackboneSize = "lite0"
    """Of the image backbone."""
    instance_channels: int = 0
    """Of the vectors that separate instances, 2 or more; 0 leaves them out (ADR 36)."""
    image_classifier: bool = False
    """Whether a public image classifier corrects it for nouns that it knows (ADR 44)."""

    def __post_init__(self) -> None:
        for name in ("width", "instance_channels"):
            require_optional_width(self, name)
        fits = self.instance_channels != 1 and (self.used or not self.instance_channels)
        expected = "0, or 2 or more with an object mask"
        require(fits, "ObjectMaskConfig.instance_channels", expected, self.instance_channels)
        _require_backbone_fits(self)
        fits = self.used or not self.image_classifier
        where = "ObjectMaskConfig.image_classifier"
        require(fits, where, "false without an object mask", self.image_classifier)

    @property
    def used(self) -> bool:
        """Whether there is such a network."""
        return self.width > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionUNetConfig:
    """Motion prior: a U-Net from one image and text to displacements and a mask (ours, ADR 22)."""

    width: int = 0
    """Channels at a quarter of the resolution; 0 leaves the prior out: the image is static."""
    heads: int = 4
    """Of text cross-attention; twice as many must divide the width."""
    mask_refiner_width: int = 0
    """Channels of the network that refines the mask at pixels (ADR 25); 0 leaves it out."""
    input_scale: int = 1
    """Sides of the copy that it sees, against that of the other networks: with the photograph's own
    pixels, or enlarged."""
    object_mask: bool = False
    """Whether it is shown the mask of the object whose motion it predicts (ADR 41)."""

    def __post_init__(self) -> None:
        require_counts(self, "heads", "input_scale")
        for name in ("width", "mask_refiner_width"):
            require_optional_width(self, name)
        fits = self.width % (2 * self.heads) == 0
        expected = f"0 or a multiple of {2 * self.heads}, twice the heads"
        require(fits, "MotionUNetConfig.width", expected, self.width)
        for name, off in (("mask_refiner_width", "0"), ("object_mask", "false")):
            fits = self.used or not getattr(self, name)
            expected = f"{off} without the network that it belongs to"
            require(fits, f"MotionUNetConfig.{name}", expected, getattr(self, name))

    @property
    def used(self) -> bool:
        """Whether there is such a network."""
        return self.width > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageInpaintingConfig:
    """Image inpainting: MI-GAN, which fills what a photograph does not show (ADR 50)."""

    widths: tuple[int, ...] = ()
    """Channels from the level of pixels to the coarsest, each of half the sides; empty: none."""

    def __post_init__(self) -> None:
        listed = isinstance(self.widths, tuple) and len(self.widths) != 1
        counts = listed and all(
            isinstance(width, int) and not isinstance(width, bool) and 0 < width <= MAX_WIDTH
            for width in self.widths
        )
        fits = counts and len(self.widths) <= MAX_LEVELS
        expected = f"none, or 2 to {MAX_LEVELS} widths from 1 to {MAX_WIDTH}"
        require(fits, "ImageInpaintingConfig.widths", expected, self.widths)

    @property
    def used(self) -> bool:
        """Whether there is such a network."""
        return len(self.widths) > 0

    @property
    def multiple_px(self) -> int:
        """What sides of its images are multiples of."""
        return 2 ** max(len(self.widths) - 1, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectShadowConfig:
    """Object shadow: a U-Net from an image and an object's mask to its shadow (ADR 57)."""

    width: int = 0
    """Channels at half the resolution; 0 leaves it out: shadows stay where they are."""

    def __post_init__(self) -> None:
        require_optional_width(self, "width")

    @property
    def used(self) -> bool:
        """Whether there is such a network."""
        return self.width > 0


def _require_backbone_fits(config: MonocularDepthConfig | ObjectMaskConfig) -> None:
    fits = config.used or not config.image_backbone
    where = type(config).__name__
    expected = "false without the network that it belongs to"
    require(fits, f"{where}.image_backbone", expected, config.image_backbone)
    fits = config.image_backbone or config.backbone_size == "lite0"
    fits = fits and config.backbone_size in get_args(BackboneSize)
    expected = "lite0, or lite2 with the image backbone"
    require(fits, f"{where}.backbone_size", expected, config.backbone_size)
