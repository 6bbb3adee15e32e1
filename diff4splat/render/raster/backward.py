"""The backward pass: blend → sums per Gaussian → colours → Gaussians and camera.

Sums over the image run in the order of the tiles, sums over Gaussians part by part in float64, so
gradients have the same bits whatever the number of threads.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster.blending.blend_backward import blend_backward, sum_slots
from diff4splat.render.raster.forward import (
    GAUSSIANS_PER_PART,
    TILES_PER_PART,
    Binned,
    Filled,
    Footprints,
    fill_region,
    numbered,
    tiles_of,
)
from diff4splat.render.raster.padded_image import PaddedImage, empty
from diff4splat.render.raster.projection.harmonics import colors_backward
from diff4splat.render.raster.projection.project_backward import (
    CAMERA_COLUMNS,
    POSITION,
    project_backward,
)
from diff4splat.render.raster.raster_settings import RasterSettings
from diff4splat.render.raster.tables import MOMENTS, Cloud, Doubles, Floats, View


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """What the backward pass needs of the forward pass."""

    plan: RasterSettings
    view: View
    footprints: Footprints
    values: Floats
    image: PaddedImage
    binned: Binned
    filled: Filled | None
    """The lists; None if there were several regions, whose lists are built again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gradients:
    """Of everything that went in."""

    cloud: Cloud
    sh: Floats
    values: Floats
    camera: Doubles
    """Rotation row by row (9), position (3), focal lengths (2), centre (2)."""


def gradients(drawn: Drawn, cloud: Cloud, sh: Floats, incoming: Floats) -> Gradients:
    """From gradients of the padded planes and the light."""
    moments = np.zeros((len(sh), MOMENTS), np.float32)
    value_grads = np.zeros(drawn.values.shape, np.float32)
    for region in drawn.binned.regions:
        filled = drawn.filled or fill_region(
            drawn.footprints, drawn.plan.grid, drawn.binned, region
        )
        _blend_backward(drawn, filled, incoming, moments, value_grads)
    grads = Cloud(*(np.zeros(array.shape, np.float32) for array in cloud))
    sh_grads = np.zeros(sh.shape, np.float32)
    visible, prints = drawn.footprints.visible, drawn.footprints.prints
    parts = ranges(len(visible), GAUSSIANS_PER_PART)
    camera = np.zeros((len(parts), CAMERA_COLUMNS))

    def work(part: int, first: int, last: int) -> None:
        project_backward(
            first, last, visible, cloud, drawn.view, drawn.plan.rules, prints, moments, grads,
            camera[part],
        )  # fmt: skip
        if drawn.plan.colors:
            colors_backward(
                first, last, visible, cloud.means, sh, drawn.view.position, value_grads, sh_grads,
                grads.means, camera[part, POSITION:],
            )  # fmt: skip

    parallel_for(work, numbered(parts))
    return Gradients(cloud=grads, sh=sh_grads, values=value_grads, camera=camera.sum(0))


def _blend_backward(
    drawn: Drawn, filled: Filled, incoming: Floats, moments: Floats, value_grads: Floats
) -> None:
    """Add the gradients of the tiles of a region."""
    order, image = drawn.footprints.order, drawn.image
    slots = empty(len(filled.lists.members), MOMENTS + drawn.values.shape[1])

    tiles = tiles_of(filled.region, drawn.plan.grid)

    def blend_tiles(first: int, last: int) -> None:
        blend_backward(
            tiles[first:last], drawn.plan.grid, filled.lists, drawn.footprints.prints, drawn.values,
            drawn.plan.rules, image.light, image.stops, incoming, slots,
        )  # fmt: skip

    def add(first: int, last: int) -> None:
        sum_slots(first, last, order, filled.first_slots, slots, moments, value_grads)

    parallel_for(blend_tiles, ranges(len(tiles), TILES_PER_PART))
    parallel_for(add, ranges(len(order), GAUSSIANS_PER_PART))
