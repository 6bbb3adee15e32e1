"""Cells half a pixel apart, between the image's pixels (ours, ADR 24).

Axes: ``h w`` pixels, ``hh ww`` = 2 h − 1, 2 w − 1 lattice points, ``t`` latent frames. From other
sides, pixels of one surface move apart: small Gaussians leave gaps, large ones blur. Lattice points
between pixels are interpolated, cubic in colour and linear in inverse depth, in which planes are
planes. Across a depth edge that gives a thin sheet, which hides less than a gap would.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera


def subpixel_infill(image: ImageLayer) -> ImageLayer:
    """The lattice without the pixels themselves; each point moves as the nearest pixel."""
    depth = 1 / _interpolate(1 / image.depth[None], "bilinear")[0]
    rows, columns = _nearest(image, depth)
    between = torch.ones_like(depth, dtype=torch.bool)
    between[::2, ::2] = False
    displacement = image.displacement
    if displacement is not None:
        ratio = depth / image.depth[rows, columns]
        displacement = displacement[:, rows, columns] * ratio[..., None]
    return ImageLayer(
        camera=lattice_camera(image.camera),
        rgb=_interpolate(image.rgb.movedim(-1, 0), "bicubic").clamp(0, 1).movedim(0, -1),
        depth=depth,
        mask=between,
        opacity=image.opacity,
        footprint_px=2 * image.footprint_px,
        displacement=displacement,
        in_image=True,
    )


def lattice_camera(camera: Camera) -> Camera:
    """The view whose pixel centres are those of ``camera`` and the points half way between."""
    height, width = camera.size_px
    twice = camera.resized((2 * height, 2 * width))
    return replace(twice, center_px=twice.center_px - 0.5, size_px=(2 * height - 1, 2 * width - 1))


def _nearest(image: ImageLayer, lattice: Float[Tensor, "hh ww"]) -> tuple[Tensor, Tensor]:
    """Row and column of the pixel nearest to each lattice point."""
    axes = [torch.arange(size, device=image.depth.device) for size in lattice.shape]
    row, column = torch.meshgrid(*axes, indexing="ij")
    return (row + 1) // 2, (column + 1) // 2


def _interpolate(maps: Float[Tensor, "c h w"], mode: str) -> Float[Tensor, "c hh ww"]:
    size = [2 * side - 1 for side in maps.shape[1:]]
    return torch.nn.functional.interpolate(maps[None], size, mode=mode, align_corners=True)[0]
