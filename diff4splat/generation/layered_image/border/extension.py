"""A coarse layer that continues the image beyond its border and behind its edges (ours).

Axes: ``h w`` pixels of the image, ``hs ws`` cells of 4 pixels with a margin on every side. Where
the camera looks past the border or behind an edge it sees a plausible blur instead of black. The
layer is static. ``push_behind_surface`` moves every cell behind all pixels that its footprint
covers: from the input camera a guess must not hide what the image shows. Nor may it hide the finer
guess of ``fine_border``, which ``push_farther_than_rings`` is for.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.border.mixed_colors import continue_colors
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.depth import depth_from_distance, distance_from_depth
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.ldrm.refinement.heads import replicate_border

BEHIND = 1.1
"""Ray distance over that of the surface in front, and depth over that of any pixel covered."""
OPACITY = 0.99
FOOTPRINT_CELLS = 0.6
REACH_SIGMAS = 3.0
"""How far a footprint reaches, in standard deviations."""


def border_extension(
    rgb: Float[Tensor, "h w 3"], depth: Float[Tensor, "h w"], camera: Camera, margin: int
) -> ImageLayer:
    """The layer of an image, with ``margin`` cells beyond each side that are not too oblique."""
    grid = extended_camera(camera, margin)
    distance = distance_from_depth(camera, depth)
    maps = torch.cat([rgb.movedim(-1, 0), distance[None]])[None]
    cells = torch.nn.functional.avg_pool2d(maps, CELL_PX)
    extended = replicate_border(cells[:, 3:], margin)[0, 0]
    return ImageLayer(
        camera=grid,
        rgb=continue_colors(cells[0, :3].movedim(0, -1), margin),
        depth=depth_from_distance(stack_cameras([grid]), BEHIND * extended[None])[0],
        mask=is_drawable(grid),
        opacity=OPACITY,
        footprint_px=FOOTPRINT_CELLS,
    )


def push_behind_surface(layer: ImageLayer, depth: Float[Tensor, "h w"], margin: int) -> ImageLayer:
    """The layer of an image of depth z ``depth``, with no cell in front of a pixel it covers."""
    farthest = BEHIND * farthest_covered(depth, margin)
    return replace(layer, depth=torch.maximum(layer.depth, farthest))


def push_farther_than_rings(layer: ImageLayer, margin: int, reach: float) -> ImageLayer:
    """The layer, with no cell in front of fine rings out to ``reach`` over the longer side.

    Rings keep the depth z of the border; at one distance z falls with the angle off the axis.
    """
    height, width = sides = [side - 2 * margin for side in layer.depth.shape]
    inner = layer.depth[margin : margin + height, margin : margin + width]
    of_border = replicate_border(inner[None, None], margin)[0, 0]
    down, across = (cells_outside(side, margin, inner.device) for side in sides)
    # One cell more: its footprint reaches into the rings.
    covered = torch.maximum(down[:, None], across) <= math.ceil(reach * max(sides)) + 1
    depth = torch.where(covered, torch.maximum(layer.depth, of_border), layer.depth)
    return replace(layer, depth=depth)


def cells_outside(side: int, margin: int, device: torch.device) -> Int[Tensor, " s"]:
    """How far beyond the border each cell along a side lies; 0 inside."""
    cells = torch.arange(-margin, side + margin, device=device)
    return torch.maximum(-cells, cells - (side - 1)).clamp_min(0)


def extended_camera(camera: Camera, margin: int, cell_px: int = CELL_PX) -> Camera:
    """The input view in cells of ``cell_px`` pixels, ``margin`` of them beyond each side."""
    height, width = (side // cell_px for side in camera.size_px)
    grid = camera.resized((height, width))
    return grid.cropped((-margin, -margin), (height + 2 * margin, width + 2 * margin))


def farthest_covered(depth: Float[Tensor, "h w"], margin: int) -> Float[Tensor, "hs ws"]:
    """Depth of the farthest pixel under each cell's footprint; 0 where it covers none."""
    reach = int(REACH_SIGMAS * FOOTPRINT_CELLS * CELL_PX) + 1
    padded = torch.nn.functional.pad(depth[None, None], (margin * CELL_PX,) * 4)
    farthest = torch.nn.functional.max_pool2d(padded, 2 * reach + 1, 1, reach)[0, 0]
    return farthest[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX]
