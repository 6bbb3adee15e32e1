"""What a moving camera disoccludes behind depth edges, at the size of the image (ours, ADR 31).

    pixels ─ depth edges ─┬─ foreground within reach of one: what the layer lies behind
                          └─ inverse depth of the rest, extended evenly, and its colours, likewise
                             with detail or inpainted by a network

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, in which
both sides of an edge are mixed: blots in the foreground's colours beside it.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.static_layer import static_layer
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.types import ImageLayer, moving_mask
from diff4splat.generation.layered_image.windows import largest_around, smallest_around

DEPTH_STEP = 0.08
"""Difference of log depth that makes an edge."""
SLOPE_SHARE = 1 / 3
"""Of the step: what the far side may still slope beside it."""
WINDOW_RADIUS_PX = 2
"""Of the window that an edge fits into: smoothed depth takes some pixels for it."""
MARGIN_SHARE = 1 / 64
"""Of the image's longer side: beside an edge, colours of the foreground are mixed in."""
REACH_SHARE = 1 / 6
"""Of the image's longer side: what a camera path disoccludes behind an edge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NearestEdge:
    """The far side of the depth edge nearest to each pixel."""

    log_depth: Float[Tensor, "h w"]
    distance_px: Float[Tensor, "h w"]


@torch.no_grad()
def occluded_layer(pixels: ImageLayer, inpaint: Inpaint = textured) -> ImageLayer | None:
    """The static layer behind the depth edges of ``pixels``; None where there is none."""
    edge = far_side_of_edges(pixels.depth)
    if not bool(edge.any()):
        return None
    nearest = nearest_edge(pixels.depth, edge)
    foreground = nearest.log_depth - pixels.depth.log() > DEPTH_STEP / 2
    # Another layer lies behind what moves.
    moving = grown(moving_mask(pixels.depth, pixels.displacement), 1)
    known = ~grown(foreground, math.ceil(MARGIN_SHARE * max(edge.shape))) & ~moving
    within = nearest.distance_px < REACH_SHARE * max(edge.shape)
    mask = grown(foreground, 1) & within & ~moving
    if not bool(known.any()) or not bool(mask.any()):
        return None
    # A footprint covers the neighbours too.
    farthest = largest_around(pixels.depth, 1)
    return static_layer(pixels, known, mask, farthest, inpaint)


def far_side_of_edges(depth: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """Pixels beside a nearer surface that are about as far as the farthest around them."""
    log_depth, rim = depth.log(), torch.ones_like(depth)
    step = log_depth - smallest_around(log_depth, WINDOW_RADIUS_PX)
    slope = largest_around(log_depth, WINDOW_RADIUS_PX) - log_depth
    # Where the window leaves the image, half a slope looks like a step.
    inner = slice(WINDOW_RADIUS_PX, -WINDOW_RADIUS_PX)
    rim[inner, inner] = 0
    return (step > DEPTH_STEP * (1 + rim)) & (slope < SLOPE_SHARE * step)


def nearest_edge(depth: Float[Tensor, "h w"], edge: Bool[Tensor, "h w"]) -> NearestEdge:
    """For every pixel, by a distance transform; there must be an edge."""
    # OpenCV takes a tenth of a second to load, which small images need not wait for.
    import cv2

    elsewhere = (~edge).cpu().numpy().astype(np.uint8)
    distance, label = cv2.distanceTransformWithLabels(
        elsewhere, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = torch.from_numpy(label).long().to(depth.device)
    of_label = depth.new_zeros(int(labels.max()) + 1)
    of_label[labels[edge]] = depth[edge].log()
    return NearestEdge(log_depth=of_label[labels], distance_px=torch.from_numpy(distance).to(depth))
