"""Relief of what moves: no deeper than an object of that size in the image.

Axes: ``y x`` pixels of the copy that the motion prior sees. Predicted depth mixes the pixels of an
object with the background beside them. Of what is static that bends an edge. What moves is torn by
it: in the image a pixel at twice the depth moves half as far.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import box_size_px, each_component
from diff4splat.generation.motion.displacement_maps import mean_of_moving

RELIEF_SHARE = 0.25
"""Of a component's extent: largest distance in depth from its median. The visible half of a ball
lies within a quarter of the diameter."""
LEAST_SHARE = 0.5
"""Share of a cell's pixels that must move, for its depth to change."""


def with_bounded_relief(
    maps: ImageMaps, depth: Float[Tensor, "y x"], moving: Bool[Tensor, "y x"], focal_px: float
) -> tuple[ImageMaps, Float[Tensor, "y x"]]:
    """``maps`` and ``depth`` of the copy, bounded where it moves; as they are if depth was given.

    Cells of the maps, where most of them moves, change as the copy does.
    """
    if has_given_depth(maps):
        return maps, depth
    bounded = bounded_relief(depth, moving, focal_px)
    return with_changed_depth(maps, bounded / depth, moving), bounded


def as_far_in_image(
    displacement: Float[Tensor, "t y x 3"],
    depth: Float[Tensor, "y x"],
    moving: Bool[Tensor, "y x"],
) -> Float[Tensor, "t y x 3"]:
    """Displacement of each component in proportion to depth: no pixel leaves its neighbour.

    One displacement in space moves what is nearer farther in the image. Of predicted relief that
    is mostly error, and opens gaps where it is steep.
    """
    share = torch.ones_like(depth)
    for inside in each_component(moving):
        share[inside] = depth[inside] / depth[inside].median()
    return displacement * share[..., None]


def has_given_depth(maps: ImageMaps) -> bool:
    """Whether depth is no prediction."""
    return maps.fine is not None and not maps.fine.smooth


def with_changed_depth(
    maps: ImageMaps, factor: Float[Tensor, "y x"], moving: Bool[Tensor, "y x"]
) -> ImageMaps:
    """``maps`` whose cells change as the copy's depth does, where most of them move."""
    change = factor.log()[None, None]
    mean, share = mean_of_moving(change, moving, len(factor) // len(maps.depth))
    factor = torch.where(share >= LEAST_SHARE, mean[0, 0], 0.0).exp()
    return replace(maps, depth=maps.depth * factor)


def bounded_relief(
    depth: Float[Tensor, "y x"], moving: Bool[Tensor, "y x"], focal_px: float
) -> Float[Tensor, "y x"]:
    """Depth whose logarithm is near the median over each connected component of ``moving``."""
    bounded = depth.clone()
    for inside in each_component(moving):
        limit = RELIEF_SHARE * max(box_size_px(inside)) / focal_px
        median = depth[inside].median()
        bounded[inside] = median * (depth[inside] / median).log().clamp(-limit, limit).exp()
    return bounded
