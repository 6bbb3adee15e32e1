"""The rim of what moves: pixels beside a mask that have the object's colour, if mixed with another.

Axes: ``h w`` pixels of the copy that the motion prior sees. A mask ends within a pixel or two of
the object's edge. What it leaves out would stay where the object was, as an outline. A wider mask
alone is no remedy: small objects would grow by half.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown

RIM_PX = 2
EDGE_SHARE = 3 / 128
"""Of the image's longer side: width of the edge in which depth may be that of the background."""
FARTHEST_SHARE = 1.05
"""Depth over that of the object's surface nearby, above which it is the background's."""
LEAST_LIKENESS = 0.5
"""Place of a colour between that of the background, 0, and of the object, 1."""
LEAST_CONTRAST = 0.08
"""Difference of both colours in [0, 1] below which likeness says nothing."""
WINDOW = 9
"""Side of the neighbourhood whose mean colours are compared."""


def with_rim(
    mask: Bool[Tensor, "h w"], depth: Float[Tensor, "h w"], rgb: Float[Tensor, "h w 3"]
) -> tuple[Bool[Tensor, "h w"], Float[Tensor, "h w"]]:
    """The mask with its rim, which takes the depth of the nearest pixel of the mask.

    Nothing changes where the mask is empty or full.
    """
    if not bool(mask.any()) or bool(mask.all()):
        return mask, depth
    beside = grown(mask, RIM_PX) & ~mask
    moving = mask | (beside & (likeness(mask, beside, rgb) > LEAST_LIKENESS))
    return moving, on_surface(moving, depth, mask)


def on_surface(
    moving: Bool[Tensor, "h w"], depth: Float[Tensor, "h w"], mask: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Depth without what lies far behind the object at its edge; ``moving`` is ``mask`` and more.

    Depth edges lie beside colour edges. What is farther than the object would move less in the
    image, and tear off.
    """
    edge_px = max(round(EDGE_SHARE * max(mask.shape)), 1)
    core = ~grown(~mask, edge_px)
    if not bool(core.any()):
        core = mask
    surface = depth.flatten()[nearest_inside(core)]
    behind = ~mask | (depth > FARTHEST_SHARE * surface)
    return torch.where(moving & ~core & behind, surface, depth)


def likeness(
    mask: Bool[Tensor, "h w"], beside: Bool[Tensor, "h w"], rgb: Float[Tensor, "h w 3"]
) -> Float[Tensor, "h w"]:
    """Where each colour lies between the means of the background and of the object near it.

    0 where one of them is not near, or both are alike.
    """
    inner = ~grown(~mask, 1)
    colors, seen = _local_mean(rgb, inner if bool(inner.any()) else mask)
    others, seen_too = _local_mean(rgb, ~mask & ~beside)
    axis = colors - others
    contrast = axis.square().sum(-1)
    place = ((rgb - others) * axis).sum(-1) / contrast.clamp_min(1e-12)
    return place.where(seen & seen_too & (contrast > LEAST_CONTRAST**2), 0.0)


def nearest_inside(mask: Bool[Tensor, "h w"]) -> Int[Tensor, "h w"]:
    """Number by rows of the nearest pixel of the mask, which must have some."""
    # OpenCV takes a tenth of a second to load, which static scenes need not wait for.
    import cv2

    outside = (~mask).cpu().numpy().astype(np.uint8)
    label = cv2.distanceTransformWithLabels(
        outside, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    inside = np.flatnonzero(outside == 0)
    pixel_of_label = np.zeros(int(label.max()) + 1, np.int64)
    pixel_of_label[label.flat[inside]] = inside
    return torch.from_numpy(pixel_of_label[label]).to(mask.device)


def _local_mean(
    rgb: Float[Tensor, "h w 3"], mask: Bool[Tensor, "h w"]
) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
    """Mean colour of the pixels of ``mask`` in the window around each, and where there are any."""
    weight = mask.to(rgb)[None]
    maps = torch.cat([rgb.movedim(-1, 0) * weight, weight])[None]
    sums = torch.nn.functional.avg_pool2d(maps, WINDOW, 1, WINDOW // 2)[0]
    return (sums[:3] / sums[3].clamp_min(1e-6)).movedim(0, -1), sums[3] > 0
