"""Depth edges: their far side, and the one nearest to each pixel (ours, ADR 31).

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.windows import largest_around, smallest_around

DEPTH_STEP = 0.08
"""Difference of log depth that makes an edge."""
SLOPE_SHARE = 1 / 3
"""Of the step: what the far side may still slope beside it."""
WINDOW_RADIUS_PX = 2
"""Of the window that an edge fits into: smoothed depth takes some pixels for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NearestEdge:
    """The far side of the depth edge nearest to each pixel."""

    pixel: Int[Tensor, "h w"]
    """Its flat index."""
    distance_px: Float[Tensor, "h w"]

    def of(self, values: Tensor) -> Tensor:
        """A map's value there, for every pixel."""
        return values.flatten()[self.pixel]


def far_side_of_edges(depth: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """Pixels beside a nearer surface that are about as far as the farthest around them."""
    log_depth, rim = depth.log(), torch.ones_like(depth)
    step = step_of_edges(depth)
    slope = largest_around(log_depth, WINDOW_RADIUS_PX) - log_depth
    # Where the window leaves the image, half a slope looks like a step.
    inner = slice(WINDOW_RADIUS_PX, -WINDOW_RADIUS_PX)
    rim[inner, inner] = 0
    return (step > DEPTH_STEP * (1 + rim)) & (slope < SLOPE_SHARE * step)


def step_of_edges(depth: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """How much farther each pixel is than the nearest around it, in log depth."""
    log_depth = depth.log()
    return log_depth - smallest_around(log_depth, WINDOW_RADIUS_PX)


def nearest_edge(edge: Bool[Tensor, "h w"]) -> NearestEdge:
    """For every pixel, by a distance transform; there must be an edge."""
    # OpenCV takes a tenth of a second to load, which small images need not wait for.
    import cv2

    elsewhere = (~edge).cpu().numpy().astype(np.uint8)
    distance, label = cv2.distanceTransformWithLabels(
        elsewhere, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = torch.from_numpy(label).long().to(edge.device)
    of_label = labels.new_zeros(int(labels.max()) + 1)
    of_label[labels[edge]] = edge.flatten().nonzero()[:, 0]
    distance_px = torch.from_numpy(distance).to(edge.device)
    return NearestEdge(pixel=of_label[labels], distance_px=distance_px)


def within(mask: Bool[Tensor, "h w"], distance_px: float) -> Bool[Tensor, "h w"]:
    """Pixels no farther than that from the nearest of ``mask``, where any is."""
    return nearest_edge(mask).distance_px <= distance_px
