"""Fine layers beside the border of an image: what a camera motion brings into view (ours).

    pixels, or the static layer behind what moves ─ smaller copy ─┬─ colours of its border, mixed,
                                                                  │  or its own, reflected, or
                                                                  │  what the network inpaints
                                                                  └─ depth of the nearest pixel

Axes: ``h w`` pixels, ``hs ws`` cells of the copy with a margin on every side. The border extension
has cells of 4 pixels of a smaller copy and reaches farther; these layers lie before it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool
from torch import Tensor
from torch.nn.functional import avg_pool2d

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.border.extension import (
    cells_outside,
    extended_camera,
)
from diff4splat.generation.layered_image.border.inpainted_colors import inpaint_colors
from diff4splat.generation.layered_image.border.mixed_colors import continue_colors
from diff4splat.generation.layered_image.border.reflected_colors import reflect_colors
from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.models.ldrm.refinement.heads import replicate_border

FOOTPRINT_CELLS = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """Where a fine layer lies, and of what it is."""

    reach: tuple[float, float]
    """From the border outward, over the image's longer side."""
    max_side: int
    """Cells along that side: more cost bytes and show no more."""
    reflected: bool = False
    """Whether it has the image's colours, reflected or inpainted, or the border's, mixed."""


NEAR = Ring(reach=(0.0, 1 / 8), max_side=256)
"""In small images a mean is best, and twice as far no better with the usual camera paths."""
PHOTOGRAPH = (
    replace(NEAR, reflected=True),
    Ring(reach=(1 / 8, 1 / 2), max_side=128, reflected=True),
)
"""Photographs end in a blurred frame without texture, 15 degrees around what is near."""


@torch.no_grad()
def fine_border(
    pixels: ImageLayer,
    disoccluded: ImageLayer | None,
    ring: Ring = NEAR,
    *,
    inpaint: Inpaint | None = None,
    nearer: ImageLayer | None = None,
) -> ImageLayer:
    """The static layer around ``pixels``; ``disoccluded`` is the one behind what moves of them.

    With ``inpaint``, its colours take the place of reflected ones, and go on from the ring that is
    ``nearer``.
    """
    source = pixels if disoccluded is None else disoccluded
    step = _cell_px(pixels.camera.size_px, ring.max_side)
    maps = torch.cat([source.rgb, (1 / source.depth)[..., None]], -1)
    cells = avg_pool2d(maps.movedim(-1, 0)[None], step)
    margin = math.ceil(ring.reach[1] * max(cells.shape[2:]))
    camera, rgb = extended_camera(pixels.camera, margin, step), cells[0, :3].movedim(0, -1)
    if ring.reflected and inpaint is not None:
        colors = inpaint_colors(rgb, camera, nearer, inpaint)
    else:
        colors = (reflect_colors if ring.reflected else continue_colors)(rgb, margin)
    return ImageLayer(
        camera=camera,
        rgb=colors,
        depth=BEHIND / replicate_border(cells[:, 3:], margin)[0, 0],
        mask=_is_in(ring, cells[0, 0], margin) & is_drawable(camera),
        opacity=OPAQUE,
        footprint_px=FOOTPRINT_CELLS,
    )


def fine_borders(
    pixels: ImageLayer,
    disoccluded: ImageLayer | None,
    rings: Sequence[Ring],
    inpaint: Inpaint | None = None,
) -> list[ImageLayer]:
    """One layer for each of the ``rings``, from the nearest outward."""
    layers: list[ImageLayer] = []
    for ring in rings:
        nearer = layers[-1] if layers else None
        layers.append(fine_border(pixels, disoccluded, ring, inpaint=inpaint, nearer=nearer))
    return layers


def _is_in(ring: Ring, cells: Tensor, margin: int) -> Bool[Tensor, "hs ws"]:
    """Whether a cell is outside of the image, and not within the ring's inner edge."""
    rows, columns = (cells_outside(side, margin, cells.device) for side in cells.shape)
    inner = math.floor(ring.reach[0] * max(cells.shape))
    return torch.maximum(rows[:, None], columns) > inner


def _cell_px(size_px: tuple[int, int], max_side: int) -> int:
    """The least side of a cell that divides the image and leaves no more cells than allowed."""
    common = math.gcd(*size_px)
    fitting = (side for side in range(1, common) if common % side == 0)
    return next((side for side in fitting if max(size_px) <= side * max_side), common)
