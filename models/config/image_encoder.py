"""Settings of the encoder whose states an image-to-video model attends to."""

from dataclasses import dataclass

from diff4splat.models.config.checks import (
    require,
    require_counts,
    require_heads,
    require_optional_width,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageEncoderConfig:
    """Vision transformer of CLIP (arXiv 2103.00020); Wan 2.1 I2V takes ViT-H/14's states."""

    width: int = 0
    """1280 in Wan; 0: no image encoder."""
    blocks: int = 31
    """Those that run: the states are those before the last block of the public encoder."""
    heads: int = 16
    feedforward_width: int = 5120
    size_px: int = 224
    """Side of the square that images are scaled and cut to."""
    patch_px: int = 14
    activation: str = "gelu"
    """gelu, or quick_gelu: x · sigmoid(1.702 x)."""

    def __post_init__(self) -> None:
        require_optional_width(self, "width")
        require_counts(self, "blocks", "heads", "feedforward_width", "size_px", "patch_px")
        known = self.activation in ("gelu", "quick_gelu")
        require(known, "ImageEncoderConfig.activation", "gelu or quick_gelu", self.activation)
        whole = self.size_px % self.patch_px == 0
        require(whole, "ImageEncoderConfig.size_px", "a multiple of patch_px", self.size_px)
        if self.used:
            require_heads(self, smallest=2)

    @property
    def used(self) -> bool:
        """Whether there is such an encoder."""
        return self.width > 0
