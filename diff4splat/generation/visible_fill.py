"""Fill that the input view would show is dropped: that view is the image, and the image is known.

Axes: ``n`` Gaussians. A cell that the image hides may still become a Gaussian whose rim reaches
around an edge or over the border. How much of a Gaussian a view shows is the gradient of the summed
image with respect to its colour.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.scene_assembly import joined
from diff4splat.generation.video.video_fill import VideoFill
from diff4splat.geometry.camera import Camera
from diff4splat.render.api import UNDILATED, render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import DEGREE_ZERO

MAX_VISIBLE_PX = 0.05
"""Pixels of the input view that one Gaussian of the fill may cover."""


def without_visible(fill: VideoFill, image: GaussianSet, camera: Camera) -> VideoFill:
    """The fill that ``camera``, which took the image, does not see, and the cells it fills."""
    both = joined(image, fill.gaussians)
    first = both.motion.state_at(both.gaussians, both.motion.time_range_s[0])
    hidden = visible_px(first, camera)[len(image.gaussians) :] <= MAX_VISIBLE_PX
    filled = fill.grid.filled.clone()
    filled.view(-1)[fill.cell_index[~hidden]] = False
    return VideoFill(
        gaussians=fill.gaussians.select(hidden),
        cell_index=fill.cell_index[hidden],
        grid=replace(fill.grid, filled=filled),
    )


def visible_px(gaussians: Gaussians, camera: Camera) -> Float[Tensor, " n"]:
    """Pixels that each Gaussian covers, each counted by the weight with which it is blended."""
    with torch.enable_grad():
        sh = torch.zeros_like(gaussians.sh[:, :1]).requires_grad_()
        plain = replace(gaussians, sh=sh)
        total = render(plain, camera, outputs=("rgb",), settings=UNDILATED).rgb.sum()
        (gradient,) = torch.autograd.grad(total, sh)
    return gradient.mean(dim=(1, 2)) / DEGREE_ZERO
