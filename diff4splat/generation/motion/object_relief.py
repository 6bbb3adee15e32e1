"""Relief of what moves: no deeper than an object of that size in the image.

Axes: ``h w`` pixels of the copy that other networks see, ``y x`` of the copy that the motion prior
sees. Predicted depth mixes the pixels of an object with the background beside them. Of what is
static that bends an edge. What moves is torn by it: in the image a pixel at twice the depth moves
half as far.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import avg_pool2d

from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import connected_components

RELIEF_SHARE = 0.25
"""Of a component's extent: largest distance in depth from its median. The visible half of a ball
lies within a quarter of the diameter."""
LEAST_SHARE = 0.5
"""Share of a cell's pixels that must move, for its depth to change."""


def bounded_relief(
    depth: Float[Tensor, "y x"], moving: Bool[Tensor, "y x"], focal_px: float
) -> Float[Tensor, "y x"]:
    """Depth whose logarithm is near the median over each connected component of ``moving``."""
    bounded, component = depth.clone(), connected_components(moving)
    for number in range(1, int(component.max()) + 1):
        inside = component == number
        limit = RELIEF_SHARE * _extent_px(inside) / focal_px
        median = depth[inside].median()
        bounded[inside] = median * (depth[inside] / median).log().clamp(-limit, limit).exp()
    return bounded


def with_relief(
    maps: ImageMaps, change: Float[Tensor, "y x"], moving: Bool[Tensor, "y x"]
) -> ImageMaps:
    """``maps`` whose cells, where most of them moves, take the ``change`` of a copy's log depth."""
    factor = change.shape[0] // maps.depth.shape[0]
    share = avg_pool2d(moving.to(change)[None, None], factor)[0, 0]
    mean = avg_pool2d((change * moving)[None, None], factor)[0, 0] / share.clamp_min(LEAST_SHARE)
    return replace(maps, depth=maps.depth * torch.where(share >= LEAST_SHARE, mean, 0.0).exp())


def _extent_px(inside: Bool[Tensor, "y x"]) -> int:
    """Of the longer side of a mask's box."""
    sides = (torch.where(inside.any(axis))[0] for axis in (0, 1))
    return max(int(side[-1] - side[0]) + 1 for side in sides)
