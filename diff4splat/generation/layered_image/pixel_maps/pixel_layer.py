"""The image's own pixels as a layer.

    image and maps ─ upsample ─ smooth, align edges ─ what moves takes its rim ─ grow foreground

Axes: ``h w`` pixels of the smaller copy, ``sh sw`` of the image, ``t`` latent frames.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.pixel_maps.depth_smoothing import smooth_maps
from diff4splat.generation.layered_image.pixel_maps.edge_alignment import align_static_edges
from diff4splat.generation.layered_image.pixel_maps.foreground import grow_foreground
from diff4splat.generation.layered_image.pixel_maps.image_maps import (
    ImageMaps,
    finest_copy,
    is_reduced,
)
from diff4splat.generation.layered_image.pixel_maps.moving_rim import with_moving_rim
from diff4splat.generation.layered_image.pixel_maps.upsampling import upsample_maps
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.models.ldrm.plane_prior import OPAQUE

PIXEL_FOOTPRINT_PX = 0.25
"""Standard deviation of a pixel's Gaussian, drawn without dilation: sharp from every side."""


def pixel_layer(small: InputImage, image: InputImage, maps: ImageMaps) -> ImageLayer:
    """One opaque cell per pixel of the image."""
    depth, displacement = _pixel_maps(small.rgb, image.rgb, maps)
    cell_px, reduced = len(image.rgb) // len(finest_copy(small, maps)), is_reduced(small, image)
    if reduced and (maps.fine is None or maps.fine.smooth):
        depth, displacement = smooth_maps(depth, displacement, image.rgb)
        depth = align_static_edges(depth, displacement, image.rgb, cell_px)
    if reduced and displacement is not None:
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
        in_surface=reduced,
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
