"""An image as layers: colour, depth, mask and displacement on the grid of a camera each.

Axes: ``h w`` rows and columns of a layer, ``t`` latent frames. Every layer stays a map until the
end, when ``gaussians.py`` makes one Gaussian of each valid cell.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera

DEPTH_STEP = 0.06
"""Difference of log depth between neighbouring pixels that makes an edge."""
NO_PIXEL = -1
"""Index of a cell whose colour no pixel of the image decides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageLayer:
    """One surface per cell."""

    camera: Camera
    """At the origin; its size is the layer's grid."""
    rgb: Float[Tensor, "h w 3"]
    depth: Float[Tensor, "h w"]
    """z in scene units; any finite number above 0 where the mask is false."""
    mask: Bool[Tensor, "h w"]
    """True where the layer has a cell."""
    opacity: float
    footprint_px: float
    """Standard deviation of a cell's Gaussian, in cells."""
    displacement: Float[Tensor, "t h w 3"] | None = None
    """From the first frame, in scene units, along the first camera's axes; None is static."""
    pixel_index: Int[Tensor, "h w"] | None = None
    """Pixel of the image, row by row, whose colour each cell has; ``NO_PIXEL`` where none."""
    in_image: bool = False
    """Whether the image shows this layer; the others extend it into what the image hides."""
    in_surface: bool = False
    """Whether Gaussians of steep cells lie in the surface; the others are round."""

    def __post_init__(self) -> None:
        size = self.camera.size_px
        found = {"rgb": self.rgb.shape[:2], "depth": self.depth.shape, "mask": self.mask.shape}
        if self.displacement is not None:
            found["displacement"] = self.displacement.shape[1:3]
        if self.pixel_index is not None:
            found["pixel_index"] = self.pixel_index.shape
        for name, got in found.items():
            if tuple(got) != size:
                raise ShapeError(f"ImageLayer.{name}: expected the grid {size}, got {tuple(got)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class LayeredImage:
    """All layers of one image; those that the image shows come first."""

    layers: tuple[ImageLayer, ...]
    ground_depth: Float[Tensor, "h w"] | None = None
    """z of the static surface at every pixel: behind what moves, else what the image shows."""

    @property
    def visible_count(self) -> int:
        """Cells of the layers that the image shows."""
        return sum(int(layer.mask.sum()) for layer in self.layers if layer.in_image)

    @property
    def visible(self) -> "LayeredImage":
        """The layers that the image shows, alone."""
        return replace(self, layers=tuple(layer for layer in self.layers if layer.in_image))


def moving_mask(
    depth: Float[Tensor, "h w"], displacement: Float[Tensor, "t h w 3"] | None
) -> Bool[Tensor, "h w"]:
    """Cells that are displaced at any time."""
    if displacement is None:
        return torch.zeros_like(depth, dtype=torch.bool)
    return displacement.any(-1).any(0)
