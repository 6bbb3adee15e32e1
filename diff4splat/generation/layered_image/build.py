"""From an image, its depth and its displacement to all layers.

    image and maps ─ upsample ─ smooth, align edges ─ grow foreground ─ pixels ─ infill  these show
    pixels ─┬─ occluded layer                                    the image; all others extend
            └─ disoccluded layer ─ fine border                       it into what it hides
    smaller copy and maps ─┬─ background layer ─┬─ inpaint what moving
                           └─ border extension ─┘  objects disocclude

A new way of filling hidden regions belongs into ``hidden_layers``.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.background_layer import background_layer
from diff4splat.generation.layered_image.border_extension import (
    border_extension,
    push_behind_surface,
)
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.disoccluded.occluded_layer import occluded_layer
from diff4splat.generation.layered_image.disocclusion import (
    inpaint_background,
    inpaint_border,
    without_disoccluded,
)
from diff4splat.generation.layered_image.fine_border import fine_border
from diff4splat.generation.layered_image.pixel_maps.depth_smoothing import smooth_maps
from diff4splat.generation.layered_image.pixel_maps.edge_alignment import align_static_edges
from diff4splat.generation.layered_image.pixel_maps.foreground import grow_foreground
from diff4splat.generation.layered_image.pixel_maps.moving_rim import with_moving_rim
from diff4splat.generation.layered_image.pixel_maps.upsampling import upsample_maps
from diff4splat.generation.layered_image.subpixel_infill import subpixel_infill
from diff4splat.generation.layered_image.types import ImageLayer, LayeredImage, moving_mask
from diff4splat.models.ldrm.plane_prior import OPAQUE

PIXEL_FOOTPRINT_PX = 0.25
"""Standard deviation of a pixel's Gaussian, drawn without dilation: sharp from every side."""


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


def build_layered_image(
    small: InputImage, image: InputImage, maps: ImageMaps, border_cells: int, infill: bool = True
) -> LayeredImage:
    """The layers of ``image``; ``small`` is the copy that ``maps`` belong to.

    Without ``infill`` between the pixels, theirs are twice as wide.
    """
    pixels = pixel_layer(small, image, maps)
    hidden, is_reduced = hidden_layers(small, maps, border_cells), _is_reduced(small, image)
    if is_reduced:
        hidden = [replace(layer, pixel_index=None) for layer in hidden]
    if (disoccluded := disoccluded_layer(pixels)) is not None:
        moving = moving_mask(maps.depth, maps.displacement)
        hidden = [disoccluded, *(without_disoccluded(layer, moving) for layer in hidden)]
    if is_reduced and (occluded := occluded_layer(pixels)) is not None:
        hidden.append(occluded)
    if border_cells:
        texture = _finest(small, maps).shape != image.rgb.shape
        hidden.append(fine_border(pixels, disoccluded, texture))
    if not infill:
        wide = replace(pixels, footprint_px=2 * PIXEL_FOOTPRINT_PX)
        return LayeredImage(layers=(wide, *hidden))
    return LayeredImage(layers=(pixels, subpixel_infill(pixels), *hidden))


def hidden_layers(small: InputImage, maps: ImageMaps, border_cells: int) -> list[ImageLayer]:
    """The background layer, and the border extension if it has any cells."""
    moving = moving_mask(maps.depth, maps.displacement)
    background = background_layer(small.rgb, maps.depth, small.camera, maps.displacement)
    layers = [inpaint_background(background, small.rgb, moving)]
    if border_cells:
        border = border_extension(small.rgb, maps.depth, small.camera, border_cells)
        border = push_behind_surface(border, maps.depth, border_cells)
        layers.append(inpaint_border(border, small.rgb, moving))
    return layers


def pixel_layer(small: InputImage, image: InputImage, maps: ImageMaps) -> ImageLayer:
    """One opaque cell per pixel of the image."""
    depth, displacement = _pixel_maps(small.rgb, image.rgb, maps)
    cell_px = len(image.rgb) // len(_finest(small, maps))
    if _is_reduced(small, image) and (maps.fine is None or maps.fine.smooth):
        depth, displacement = smooth_maps(depth, displacement, image.rgb)
        depth = align_static_edges(depth, displacement, image.rgb, cell_px)
        if displacement is not None:
            depth, displacement = with_moving_rim(depth, displacement, image.rgb)
    depth, displacement = grow_foreground(depth, displacement, cell_px)
    return ImageLayer(
        camera=image.camera,
        rgb=image.rgb,
        depth=depth,
        mask=torch.ones_like(depth, dtype=torch.bool),
        opacity=OPAQUE,
        footprint_px=PIXEL_FOOTPRINT_PX,
        displacement=displacement,
        pixel_index=torch.arange(depth.numel(), device=depth.device).view_as(depth),
        in_image=True,
    )


def _pixel_maps(
    small: Float[Tensor, "h w 3"], full: Float[Tensor, "sh sw 3"], maps: ImageMaps
) -> tuple[Float[Tensor, "sh sw"], Float[Tensor, "t sh sw 3"] | None]:
    """Depth and displacement of every pixel, through the larger copy where there is one."""
    fine = maps.fine
    if fine is None or small.shape == full.shape:
        return upsample_maps(maps.depth, maps.displacement, (small, full))
    displacement = fine.displacement
    if displacement is None and maps.displacement is not None:
        depth, displacement = upsample_maps(maps.depth, maps.displacement, (small, fine.rgb))
        displacement = displacement * (fine.depth / depth)[..., None]
    return upsample_maps(fine.depth, displacement, (fine.rgb, full))


def _is_reduced(small: InputImage, image: InputImage) -> bool:
    """Whether networks see less than the image's pixels."""
    return small.camera.size_px != image.camera.size_px


def _finest(small: InputImage, maps: ImageMaps) -> Float[Tensor, "h w 3"]:
    """The largest copy that depth belongs to."""
    return small.rgb if maps.fine is None else maps.fine.rgb
