"""The layered image and the video model's fill as one set of Gaussians.

Axes: ``n`` Gaussians, ``f h w`` frames, rows and columns of the fill's grid. An extended layer is
only a guess. Where the fill shows something else, a guess in front of it is dropped.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.video.hidden_cells import FillGrid
from diff4splat.generation.video.video_fill import VideoFill
from diff4splat.geometry.camera import project
from diff4splat.scene.gaussians import concatenate
from diff4splat.scene.motion.keyframe_algebra import join

OCCLUSION_MARGIN = 1.05
"""Depth over that of a filled cell up to which a guess would hide it."""


def combine(image: GaussianSet, visible_count: int, fill: VideoFill) -> GaussianSet:
    """The layered image's Gaussians without guesses that hide the fill, then the fill's.

    The first ``visible_count`` Gaussians of ``image`` are shown by the image and stay.
    """
    guesses = image.gaussians.means[visible_count:]
    kept = torch.ones(len(image.gaussians), dtype=torch.bool, device=guesses.device)
    kept[visible_count:] = ~hides_fill(guesses, fill.grid)
    return joined(image.select(kept), fill.gaussians)


def joined(first: GaussianSet, second: GaussianSet) -> GaussianSet:
    """The Gaussians of both, in this order."""
    return GaussianSet(
        gaussians=concatenate([first.gaussians, second.gaussians]),
        motion=join(first.motion, second.motion, len(first.gaussians)),
        pixel_index=torch.cat([first.pixel_index, second.pixel_index]),
    )


def hides_fill(means: Float[Tensor, "n 3"], grid: FillGrid) -> Bool[Tensor, " n"]:
    """Which points lie in front of a filled cell, or on it, for any of the grid's cameras."""
    hides = torch.zeros(len(means), dtype=torch.bool, device=means.device)
    height, width = grid.cameras.size_px
    for index, camera in enumerate(grid.cameras):
        filled, depth = grid.filled[index], grid.depth[index]
        pixels, z = project(camera, means)
        column, row = pixels.nan_to_num(-1).floor().long().unbind(-1)
        inside = (z > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        cell = (row.clamp(0, height - 1), column.clamp(0, width - 1))
        hides |= inside & filled[cell] & (z < OCCLUSION_MARGIN * depth[cell])
    return hides
