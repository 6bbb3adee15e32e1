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
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.layered_image.windows import mean_around

RIM_PX = 2
EDGE_SHARE = 4 / 128
"""Of the image's longer side: width of the edge in which depth may be that of the background."""
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
    """Depth no farther than the object's surface at its edge; ``moving`` is ``mask`` and more.

    Depth edges lie beside colour edges. What is farther than the object would move less in the
    image, and tear off; so does what is suddenly nearer.
    """
    edge_px = max(round(EDGE_SHARE * max(mask.shape)), 1)
    core = core_of_components(mask, edge_px)
    surface = depth.flatten()[nearest_inside(core)]
    surface = mean_around(surface, edge_px)
    on_edge = torch.where(mask, torch.minimum(depth, surface), surface)
    return torch.where(moving & ~core, on_edge, depth)


def core_of_components(mask: Bool[Tensor, "h w"], edge_px: int) -> Bool[Tensor, "h w"]:
    """Each component without its edge; one that is nothing but edge as it is."""
    core, component = ~grown(~mask, edge_px), connected_components(mask)
    return core | (mask & ~torch.isin(component, component[core]))


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
