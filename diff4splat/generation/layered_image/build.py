"""From an image, its depth and its displacement to all layers.

    image and maps ─ upsample ─ smooth, align edges ─ grow foreground ─ pixels ─ infill  these show
    pixels ─┬─ occluded layers ── ground                         the image; all others extend
            │                                                        it into what it hides
            └─ disoccluded layer ─┬─ fine border
                                  └─ sharp colours
    smaller copy and maps ─┬─ background layer ─┬─ inpaint what moving ─ colours of the ground
                           └─ border extension ─┘  objects disocclude

A new way of filling hidden regions belongs into ``hidden_layers``.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.background_layer import (
    background_layer,
    farther_than_pixels,
)
from diff4splat.generation.layered_image.border.extension import (
    border_extension,
    push_behind_surface,
    push_farther_than_rings,
)
from diff4splat.generation.layered_image.border.fine_border import NEAR, PHOTOGRAPH, fine_borders
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.disoccluded.occluded_layer import (
    OccludedLayers,
    occluded_layers,
)
from diff4splat.generation.layered_image.disoccluded.patch_texture import with_patch_texture
from diff4splat.generation.layered_image.disoccluded.sharp_colors import with_sharp_colors
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disoccluded.two_scales import agreeing_scales
from diff4splat.generation.layered_image.disocclusion import (
    inpaint_background,
    inpaint_border,
    without_disoccluded,
)
from diff4splat.generation.layered_image.ground_colors import (
    GROUND_SHARE,
    INPAINTED_SHARE,
    with_ground_colors,
)
from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.pixel_maps.image_maps import (
    ImageMaps,
    finest_copy,
    is_reduced,
)
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import (
    PIXEL_FOOTPRINT_PX,
    pixel_layer,
)
from diff4splat.generation.layered_image.subpixel_infill import subpixel_infill
from diff4splat.generation.layered_image.types import ImageLayer, LayeredImage, moving_mask
from diff4splat.generation.object_shadow.shadow import without_shadows


def build_layered_image(
    small: InputImage,
    image: InputImage,
    maps: ImageMaps,
    border_cells: int,
    *,
    infill: bool = True,
    inpaint: Inpaint | None = None,
) -> LayeredImage:
    """The layers of ``image``; ``small`` is the copy that ``maps`` belong to.

    Without ``infill`` between the pixels, theirs are twice as wide. ``inpaint`` gives colours to
    what is hidden, in place of shifted patches and a reflected border. Shadows of what moves are
    taken off all layers.
    """
    with_shadows = image.rgb
    small, image, maps = _without_shadows(small, image, maps)
    pixels, reduced = pixel_layer(small, image, maps), is_reduced(small, image)
    if maps.shadows:
        moves = moving_mask(pixels.depth, pixels.displacement)[..., None]
        pixels = replace(pixels, rgb=torch.where(moves, with_shadows, pixels.rgb))
    is_photograph = inpaint is not None or finest_copy(small, maps).shape != image.rgb.shape
    rings = PHOTOGRAPH if is_photograph else (NEAR,)
    hidden = hidden_layers(small, maps, pixels, border_cells)
    if border_cells and is_photograph:  # In small images its blur is the better guess.
        hidden[-1] = push_farther_than_rings(hidden[-1], border_cells, rings[-1].reach[1])
    inpaint_hole = textured if inpaint is None else inpaint
    occluded = occluded_layers(pixels, inpaint_hole) if reduced else OccludedLayers()
    if reduced:
        hidden = [replace(layer, pixel_index=None) for layer in hidden]
    if occluded.ground is not None:
        share = GROUND_SHARE if inpaint is None else INPAINTED_SHARE
        hidden = [with_ground_colors(layer, pixels, occluded.ground, share) for layer in hidden]
    inpaint_behind = textured if inpaint is None else with_patch_texture(agreeing_scales(inpaint))
    if (disoccluded := disoccluded_layer(pixels, inpaint_behind)) is not None:
        moving = moving_mask(maps.depth, maps.displacement)
        layer = disoccluded if inpaint is None else with_sharp_colors(disoccluded)
        hidden = [layer, *(without_disoccluded(each, moving) for each in hidden)]
    hidden += occluded.all
    if border_cells:
        hidden += fine_borders(pixels, disoccluded, rings, inpaint)
    ground = pixels.depth
    if disoccluded is not None:
        moves = moving_mask(pixels.depth, pixels.displacement)
        ground = torch.where(moves & disoccluded.mask, disoccluded.depth, ground)
    if not infill:
        wide = replace(pixels, footprint_px=2 * PIXEL_FOOTPRINT_PX)
        return LayeredImage(layers=(wide, *hidden), ground_depth=ground)
    layers = (pixels, subpixel_infill(pixels), *hidden)
    return LayeredImage(layers=layers, ground_depth=ground)


def _without_shadows(
    small: InputImage, image: InputImage, maps: ImageMaps
) -> tuple[InputImage, InputImage, ImageMaps]:
    """All three without the shadows of what moves."""
    if not maps.shadows:
        return small, image, maps
    small, image = (
        replace(one, rgb=without_shadows(one.rgb, maps.shadows)) for one in (small, image)
    )
    if maps.fine is not None:
        fine = replace(maps.fine, rgb=without_shadows(maps.fine.rgb, maps.shadows))
        maps = replace(maps, fine=fine)
    return small, image, maps


def hidden_layers(
    small: InputImage, maps: ImageMaps, pixels: ImageLayer, border_cells: int
) -> list[ImageLayer]:
    """The background layer, and the border extension if it has any cells, behind ``pixels``."""
    moving = moving_mask(maps.depth, maps.displacement)
    farthest = farthest_depth(maps.depth, pixels.depth)
    background = background_layer(small.rgb, maps.depth, small.camera, maps.displacement)
    background = farther_than_pixels(background, farthest)
    layers = [inpaint_background(background, small.rgb, moving)]
    if border_cells:
        border = border_extension(small.rgb, maps.depth, small.camera, border_cells)
        border = push_behind_surface(border, farthest, border_cells)
        layers.append(inpaint_border(border, small.rgb, moving))
    return layers


def farthest_depth(
    depth: Float[Tensor, "h w"], of_pixels: Float[Tensor, "y x"]
) -> Float[Tensor, "h w"]:
    """Of each pixel of the smaller copy: its own, or that of the farthest of the image's in it.

    The image's depth has edges of its own; layers as near as the smaller copy's would be seen.
    """
    farthest = torch.nn.functional.adaptive_max_pool2d(of_pixels[None], depth.shape)[0]
    return torch.maximum(depth, farthest)
