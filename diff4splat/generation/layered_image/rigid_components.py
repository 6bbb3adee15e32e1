"""Rigid translation of every connected component of moving pixels (ours, ADR 25).

Axes: ``t`` latent frames, ``h w`` pixels of the smaller copy that the networks see, ``hc wc`` its
cells of 4 pixels. Displacement is predicted per cell and depth per pixel, and neither agrees
exactly with itself: an object would tear as it moves. A component that turns or bends has a short
mean displacement, which is no sign of translation, and stays static.
"""

from collections.abc import Iterator

import cv2
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.models.motion_unet.motion_field import UNIT, masked_offsets, upsample_to_pixels

MIN_RELATIVE_DISPLACEMENT = 0.1
"""Over its depth; a component whose mean displacement is shorter is static (0.24 is typical)."""


def rigid_component_offsets(
    field: Float[Tensor, "3 t hc wc"],
    moving: Bool[Tensor, "h w"],
    depth: Float[Tensor, "h w"],
    mean_field: Float[Tensor, "3 t hc wc"] | None = None,
) -> Float[Tensor, "t h w 3"]:
    """Displacement of every pixel at the time of every latent frame, in scene units.

    Each component is translated by its mean displacement at its median depth. Which ones move is
    decided on ``mean_field`` if that is given: a sample is noisier than the mean of all samples.
    """
    relative, place = upsample_to_pixels(field), depth.clone()
    typical = relative.clone() if mean_field is None else upsample_to_pixels(mean_field)
    for inside in each_component(moving):
        mean = relative[:, :, inside].mean(-1, keepdim=True)
        expected = typical[:, :, inside].mean(-1, keepdim=True)
        moves = expected.norm(dim=1).max() * UNIT >= MIN_RELATIVE_DISPLACEMENT
        relative[:, :, inside] = mean * moves
        place[inside] = depth[inside].median()
    return masked_offsets(relative, moving, place)


def box_size_px(mask: Bool[Tensor, "h w"]) -> tuple[int, int]:
    """Height and width of the box around a mask, which must not be empty."""
    rows, columns = box_around(mask)
    return rows.stop - rows.start, columns.stop - columns.start


def box_around(mask: Bool[Tensor, "h w"]) -> tuple[slice, slice]:
    """Rows and columns of the box around a mask, which must not be empty."""
    spans = (torch.where(mask.any(axis))[0].tolist() for axis in (1, 0))
    rows, columns = (slice(span[0], span[-1] + 1) for span in spans)
    return rows, columns


def each_component(mask: Bool[Tensor, "h w"]) -> Iterator[Bool[Tensor, "h w"]]:
    """The mask of every connected component, one after the other."""
    component = connected_components(mask)
    return (component == number for number in range(1, int(component.max()) + 1))


def connected_components(mask: Bool[Tensor, "h w"]) -> Int[Tensor, "h w"]:
    """Number of the component that a pixel belongs to, 0 outside the mask; corners connect."""
    array = mask.to(device="cpu", dtype=torch.uint8).numpy()
    number = cv2.connectedComponents(array, connectivity=8)[1]
    return torch.from_numpy(number).to(device=mask.device, dtype=torch.int64)
