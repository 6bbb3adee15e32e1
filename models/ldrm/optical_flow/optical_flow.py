"""Optical flow from gradients, and from blocks where a displacement is too large for gradients.

    source, target ─┬─ Lucas and Kanade, from the start ─────────────────────────────┬─ flow
                    └─ blocks, at half the resolution ─ Lucas and Kanade from there ─┘

Axes: ``n`` pairs of images, ``h w`` pixels. Per pixel the flow with the smaller difference of
colours counts.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.blocks.resize import upsample_nearest
from diff4splat.models.ldrm.optical_flow.block_matching import (
    LARGEST_DIFFERENCE,
    matched_displacement,
)
from diff4splat.models.ldrm.optical_flow.lucas_kanade import track_flow, warp
from diff4splat.models.ldrm.window_mean import window_mean

REDUCTION = 2
"""Of the images in which blocks are matched."""
FROM_MATCHES = (1,)
"""Pyramid of Lucas and Kanade's method from there: a match is off by a pixel."""
NEIGHBOURHOOD_PX, LEAST_SHARE = 9, 0.05
"""Reduced pixels around a match, and share of matches there, that may have its displacement."""
COMPARED_PX = 5
SMALLER_SHARE = 0.85
"""Of the difference after the first flow, below which the second counts."""


def optical_flow(
    source: Float[Tensor, "n 3 h w"],
    target: Float[Tensor, "n 3 h w"],
    start: Float[Tensor, "n 2 h w"],
) -> Float[Tensor, "n 2 h w"]:
    """Flow (right, down) in pixels from ``source`` to ``target``, initialised with ``start``."""
    flow = track_flow(source, target, start)
    matched, near_match = _matched(source, target)
    other = track_flow(source, target, torch.where(near_match, matched, flow), FROM_MATCHES)
    better = _difference(source, target, other) < SMALLER_SHARE * _difference(source, target, flow)
    return torch.where(near_match & better, other, flow)


def _matched(
    source: Float[Tensor, "n 3 h w"], target: Float[Tensor, "n 3 h w"]
) -> tuple[Float[Tensor, "n 2 h w"], Bool[Tensor, "n 1 h w"]]:
    """Mean displacement of the matches around every pixel, its own if it has one; where any is."""
    reduced = [torch.nn.functional.avg_pool2d(image, REDUCTION) for image in (source, target)]
    displacement, found = matched_displacement(*reduced)
    count = found[:, None].to(displacement)
    share = window_mean(count, NEIGHBOURHOOD_PX)
    mean = window_mean(count * displacement, NEIGHBOURHOOD_PX) / share.clamp_min(LEAST_SHARE)
    displacement = torch.where(found[:, None], displacement, mean)
    near = upsample_nearest((share > LEAST_SHARE).to(displacement), REDUCTION) > 0
    return upsample_nearest(displacement, REDUCTION) * REDUCTION, near


def _difference(source: Tensor, target: Tensor, flow: Tensor) -> Float[Tensor, "n 1 h w"]:
    """Of colours after ``flow``, over a window."""
    difference = (warp(target, flow) - source).abs().mean(1, keepdim=True)
    return window_mean(difference.clamp_max(LARGEST_DIFFERENCE), COMPARED_PX)
