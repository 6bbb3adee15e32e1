"""What a moving camera disoccludes behind depth edges, at the size of the image (ours, ADR 31).

    pixels ─ depth edges ─┬─ foreground within reach of one: what the layer lies behind
                          └─ inverse depth and colours of the rest, extended evenly, with detail

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, in which
both sides of an edge are mixed: blots in the foreground's colours beside it.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.even_extension import extended_evenly
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

DEPTH_STEP = 0.15
"""Difference of log depth that makes an edge."""
WINDOW_PX = 5
"""Side of the window that an edge fits into: smoothed depth takes some pixels for it."""
REACH_SHARE = 1 / 6
"""Of the image's longer side: what a camera path disoccludes behind an edge."""
FOOTPRINT_PX = 0.5
"""Standard deviation of a cell's Gaussian: without gaps between neighbours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NearestEdge:
    """The far side of the depth edge nearest to each pixel."""

    log_depth: Float[Tensor, "h w"]
    distance_px: Float[Tensor, "h w"]


@torch.no_grad()
def occluded_layer(pixels: ImageLayer) -> ImageLayer | None:
    """The static layer behind the depth edges of ``pixels``; None where there is none."""
    edge = far_side_of_edges(pixels.depth)
    if not bool(edge.any()):
        return None
    nearest = nearest_edge(pixels.depth, edge)
    foreground = nearest.log_depth - pixels.depth.log() > DEPTH_STEP / 2
    moving = _moving(pixels)
    known = ~grown(foreground, 1) & ~moving
    within = nearest.distance_px < REACH_SHARE * max(edge.shape)
    mask = grown(foreground, 1) & within & ~moving & is_drawable(pixels.camera)
    if not bool(known.any()) or not bool(mask.any()):
        return None
    depth = 1 / extended_evenly(1 / pixels.depth, known)
    # A footprint covers the neighbours too.
    farthest = torch.nn.functional.max_pool2d(pixels.depth[None], 3, 1, 1)[0]
    return replace(
        pixels,
        rgb=textured(pixels.rgb, known),
        depth=torch.maximum(depth, BEHIND * farthest),
        mask=mask,
        footprint_px=FOOTPRINT_PX,
        displacement=None,
        pixel_index=torch.full_like(edge, NO_PIXEL, dtype=torch.long),
        in_image=False,
    )


def far_side_of_edges(depth: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """Pixels beside a nearer surface that are about as far as the farthest around them."""
    half = WINDOW_PX // 2
    log_depth = depth.log()
    around = torch.nn.functional.pad(log_depth[None, None], (half,) * 4, mode="replicate")
    farthest = torch.nn.functional.max_pool2d(around, WINDOW_PX, 1)[0, 0]
    nearest = -torch.nn.functional.max_pool2d(-around, WINDOW_PX, 1)[0, 0]
    return (log_depth - nearest > DEPTH_STEP) & (farthest - log_depth < DEPTH_STEP / 3)


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


def _moving(pixels: ImageLayer) -> Bool[Tensor, "h w"]:
    """What moves and the pixels beside it: another layer lies behind them."""
    if pixels.displacement is None:
        return torch.zeros_like(pixels.mask)
    return grown(pixels.displacement.any(-1).any(0), 1)
