"""Cells half a pixel apart, between the cells of a layer at the size of the image (ours, ADR 24).

Axes: ``h w`` pixels, ``hh ww`` = 2 h − 1, 2 w − 1 lattice points, ``v`` = w − 1, ``t`` latent
frames. From other sides, pixels of one surface move apart: small Gaussians leave gaps, large ones
blur. Lattice points between pixels are interpolated, cubic in colour and linear in inverse depth,
in which planes are planes. Across a depth edge they have depth and colour of the far side: in
between, they would be an outline of their own from other sides. At the outline of what moves there
are none.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer, moving_mask
from diff4splat.generation.layered_image.windows import largest_around
from diff4splat.geometry.camera import Camera

KERNEL_RADIUS = 3
"""Of the cubic kernel, in steps of the lattice."""
SLOPE_FACTOR = 2.0
"""An edge is so many times as high as the steps beside it."""


def subpixel_infill(image: ImageLayer) -> ImageLayer:
    """The lattice without pixels and outlines; each point moves as the nearest pixel.

    Where the layer has no cells, neither has the lattice.
    """
    depth, rgb = _lattice_maps(image)
    rows, columns = _nearest(image, depth)
    between = torch.ones_like(depth, dtype=torch.bool)
    between[::2, ::2] = False
    between &= -_largest_neighbour(-image.mask.to(depth)) > 0
    displacement = image.displacement
    between &= ~_between_moving_and_static(moving_mask(image.depth, displacement))
    if displacement is not None:
        ratio = depth / image.depth[rows, columns]
        displacement = displacement[:, rows, columns] * ratio[..., None]
    return ImageLayer(
        camera=lattice_camera(image.camera),
        rgb=rgb,
        depth=depth,
        mask=between,
        opacity=image.opacity,
        footprint_px=2 * image.footprint_px,
        displacement=displacement,
        in_image=image.in_image,
        in_surface=image.in_surface,
    )


def _lattice_maps(image: ImageLayer) -> tuple[Float[Tensor, "hh ww"], Float[Tensor, "hh ww 3"]]:
    """Depth and colours; across an edge of static pixels both are those of the far side.

    Beside an edge the cubic kernel would see both sides, and draw a bright or dark outline.
    """
    depth, rgb = image.depth, image.rgb.movedim(-1, 0)
    moving = moving_mask(depth, image.displacement)
    far_side = _edges(depth.log()) & (_largest_neighbour(moving.to(depth)) == 0)
    near_edge = largest_around(far_side.to(depth), KERNEL_RADIUS) > 0
    # Channel by channel: three at once are rounded otherwise on another number of threads.
    linear = torch.cat([_interpolate(channel[None], "bilinear") for channel in rgb])
    colors = torch.where(near_edge, linear, _interpolate(rgb, "bicubic"))
    even = 1 / _interpolate(1 / depth[None], "bilinear")[0]
    farthest = _farthest_neighbour(depth)
    colors = torch.where(far_side, rgb.flatten(1)[:, farthest], colors).clamp(0, 1)
    return torch.where(far_side, depth.flatten()[farthest], even), colors.movedim(0, -1)


def _between_moving_and_static(moving: Bool[Tensor, "h w"]) -> Bool[Tensor, "hh ww"]:
    """Lattice points of mixed colour at the outline of what moves.

    They would draw it wherever they are: along with the object, or where it was.
    """
    value = moving.float()
    return _largest_neighbour(value) != -_largest_neighbour(-value)


def _edges(log_depth: Float[Tensor, "h w"]) -> Bool[Tensor, "hh ww"]:
    """Lattice points between pixels of two surfaces."""
    across, down = _steps_apart(log_depth), _steps_apart(log_depth.mT).mT
    height, width = log_depth.shape
    edge = across.new_zeros(2 * height - 1, 2 * width - 1)
    edge[::2, 1::2], edge[1::2, ::2] = across, down
    edge[1::2, 1::2] = across[1:] | across[:-1] | down[:, 1:] | down[:, :-1]
    return edge


def _steps_apart(log_depth: Float[Tensor, "h w"]) -> Bool[Tensor, "h v"]:
    """Between each pixel and the next of its row: a step, and not a slope that goes on."""
    step = log_depth.diff(dim=1).abs()
    if step.shape[1] < 2:
        return torch.zeros_like(step, dtype=torch.bool)
    beside = torch.cat([step[:, 1:2], step, step[:, -2:-1]], 1)
    slope = torch.maximum(beside[:, :-2], beside[:, 2:])
    return (step > DEPTH_STEP) & (step > SLOPE_FACTOR * slope)


def _largest_neighbour(values: Float[Tensor, "h w"]) -> Float[Tensor, "hh ww"]:
    """Of the two or four pixels around each lattice point."""
    return _with_larger_between(_with_larger_between(values).mT).mT


def _with_larger_between(values: Float[Tensor, "h w"]) -> Float[Tensor, "hh w"]:
    """The rows, and between every two of them the larger values."""
    rows = values.new_empty(2 * len(values) - 1, values.shape[1])
    rows[::2] = values
    rows[1::2] = torch.maximum(values[:-1], values[1:])
    return rows


def _farthest_neighbour(depth: Float[Tensor, "h w"]) -> Int[Tensor, "hh ww"]:
    """Flat index of the farthest of the two or four pixels around each lattice point."""
    height, width = depth.shape
    rows, columns = (torch.arange(2 * side - 1, device=depth.device) for side in (height, width))
    corners = [
        ((rows + down) // 2)[:, None] * width + (columns + right) // 2
        for down in (0, 1)
        for right in (0, 1)
    ]
    # Not an argmax: of equal depths it may take another on another number of threads.
    flat, farthest = depth.flatten(), corners[0]
    for corner in corners[1:]:
        farthest = torch.where(flat[corner] > flat[farthest], corner, farthest)
    return farthest


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
