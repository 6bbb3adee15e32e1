"""Many images of one scene; what is still valid from the previous image is reused.

- Static Gaussians are projected, sorted and binned once per camera.
- What moves is projected straight from its motion; no state of the scene is stored.
- While the camera is static, only tiles that a moving Gaussian overlaps, or overlapped in the
  previous image, are blended.
- The large arrays live as long as the sequence.

Images are those of ``render`` without gradients, up to the rounding of states to float32.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster import forward as stages
from diff4splat.render.raster.blending.blend import FIXED
from diff4splat.render.raster.blending.depth_sort import depth_sort
from diff4splat.render.raster.blending.merge import merge_lists, merge_orders
from diff4splat.render.raster.forward import Footprints
from diff4splat.render.raster.function import Raster
from diff4splat.render.raster.padded_image import PaddedImage, empty
from diff4splat.render.raster.projection.harmonics import colors
from diff4splat.render.raster.projection.moving import Moving
from diff4splat.render.raster.projection.project import SH, project
from diff4splat.render.raster.raster_settings import RasterSettings
from diff4splat.render.raster.tables import (
    Integers,
    Lists,
    ProjectionInputs,
    ProjectionOutputs,
    View,
)
from diff4splat.scene.motion.times import require_time_s
from diff4splat.scene.scene import Scene


@dataclass(slots=True)
class _Still:
    """Projection of the static Gaussians."""

    view: View
    order: Integers
    unusable: NDArray[np.int64]
    lists: Lists | None = None
    """Built when the camera is used again; None before, or if they do not fit."""
    too_large: bool = False


class Sequence:
    """A scene to be drawn many times, by one plan; ``depths`` blends z and 1 behind the colours."""

    def __init__(self, scene: Scene, plan: RasterSettings, depths: bool) -> None:
        gaussians = scene.gaussians
        self._plan, self._depths = plan, depths
        self._moving = Moving(scene)
        self._cloud = self._moving.cloud
        self._sh = self._moving.sh
        count = len(gaussians)
        self._prints, self._depth = empty(count, 8, dtype=torch.float64), empty(count)
        moves = np.zeros(count, bool)
        moves[self._moving.index] = True
        self._still_index = np.flatnonzero(~moves).astype(np.int32)
        channels = (3 if plan.colors else 0) + (2 if depths else 0)
        self._values = np.zeros((count, max(channels, FIXED)), np.float32)
        self._used = channels
        self._image = PaddedImage(plan.grid, self._values.shape[1], plan.medians)
        self._still: _Still | None = None
        # Colours without harmonics do not depend on the view.
        self._colors_change = plan.colors and (self._moving.recolors or self._sh.shape[1] > 1)
        if plan.colors:
            self._color(np.arange(count, dtype=np.int32), (0.0, 0.0, 0.0))
        self._stale = np.ones(plan.grid.rows * plan.grid.columns, bool)

    @property
    def depth(self) -> Float[Tensor, " n"]:
        """Z of every Gaussian that the last image could see; any number for the others."""
        return torch.from_numpy(self._depth)

    def draw(self, view: View, time_s: float, rows: tuple[int, int] | None = None) -> Raster:
        """The image at ``time_s``.

        With pixel ``rows`` (first, one past last) only the tiles in these rows are brought up to
        the time while the camera is static; the others keep what they showed, as under a rolling
        shutter.

        Raises:
            InputError: the time is not a finite number of seconds.
        """
        require_time_s(time_s)
        same_camera = self._still is not None and self._still.view == view
        if not same_camera:
            self._see_still(view)
        order, unusable = self._see_moving(view, time_s)
        tiles_in_rows = self._tiles_in(rows if same_camera else None)
        if not (same_camera and self._bin_still() and self._draw_stale(order, tiles_in_rows)):
            self._draw_all(order, tiles_in_rows)
            # Any of them may show something that moves; nobody kept which.
            self._stale[:] = True
        return self._raster(unusable + self._still.unusable)

    def _see_still(self, view: View) -> None:
        """Project, sort and colour what does not move."""
        unusable, numbers = (
            np.zeros(SH + 1, np.int64),
            self._sh.reshape(len(self._sh), self._sh.shape[1] * 3),
        )
        index = self._still_index
        inputs = ProjectionInputs(self._cloud, numbers, view, self._plan.rules)

        def work(first: int, last: int, visible: Integers, faults: NDArray[np.int64]) -> int:
            outputs = ProjectionOutputs(self._prints, self._depth, visible, faults)
            return project(first, last, index, inputs, outputs)

        visible = stages.list_visible(len(index), work, unusable)
        self._still = _Still(view, depth_sort(visible, self._depth), unusable)
        self._fill_values(view, visible)

    def _see_moving(self, view: View, time_s: float) -> tuple[Integers, NDArray[np.int64]]:
        """Move, project, sort and colour the others."""
        unusable = np.zeros(SH + 1, np.int64)
        visible = self._moving.project(
            self._plan, view, time_s, self._prints, self._depth, unusable
        )
        self._fill_values(view, visible)
        return depth_sort(visible, self._depth), unusable

    def _fill_values(self, view: View, visible: Integers) -> None:
        """Colours and depth channels of some Gaussians."""
        if self._colors_change:
            self._color(visible, view.position)
        if self._depths:
            self._values[visible, self._used - 2] = self._depth[visible]
            self._values[visible, self._used - 1] = 1

    def _color(self, visible: Integers, position: tuple[float, ...]) -> None:
        def work(first: int, last: int) -> None:
            colors(first, last, visible, self._cloud.means, self._sh, position, self._values)

        parallel_for(work, ranges(len(visible), stages.GAUSSIANS_PER_PART))

    def _bin_still(self) -> bool:
        """Whether there are lists of the static Gaussians; built when a camera is used again."""
        still = self._still
        if still.lists is None and not still.too_large:
            found = self._footprints(still.order)
            binned = stages.bin_footprints(found, self._plan)
            still.too_large = len(binned.regions) > 1
            if not still.too_large:
                region = binned.regions[0]
                still.lists = stages.fill_region(found, self._plan.grid, binned, region).lists
        return not still.too_large

    def _draw_all(self, moving: Integers, wanted: NDArray[np.bool_]) -> None:
        """Blend every tile that is ``wanted``, from lists of everything, region by region."""
        order = np.empty(len(self._still.order) + len(moving), np.int32)
        merge_orders(self._still.order, moving, self._depth, order)
        found = self._footprints(order)
        binned = stages.bin_footprints(found, self._plan)
        for region in binned.regions:
            lists = stages.fill_region(found, self._plan.grid, binned, region).lists
            tiles = stages.tiles_of(region, self._plan.grid)
            tiles = tiles[wanted[tiles]]
            stages.blend_tiles(self._plan, tiles, lists, self._prints, self._values, self._image)

    def _draw_stale(self, moving: Integers, wanted: NDArray[np.bool_]) -> bool:
        """Blend the ``wanted`` tiles that show, or are to show, something that moves.

        False, and nothing done, where their lists would not fit.
        """
        found, grid = self._footprints(moving), self._plan.grid
        binned = stages.bin_footprints(found, self._plan)
        if len(binned.regions) > 1:
            return False
        lists = stages.fill_region(found, grid, binned, binned.regions[0]).lists
        touched = np.diff(lists.starts) > 0
        self._stale |= touched
        tiles = np.flatnonzero(self._stale & wanted)
        merged = self._merged_lists(lists, tiles)
        if merged is None:
            return False
        stages.blend_tiles(self._plan, tiles, merged, self._prints, self._values, self._image)
        self._stale[tiles] = touched[tiles]
        return True

    def _merged_lists(self, moving: Lists, tiles: NDArray[np.int64]) -> Lists | None:
        """Lists of some tiles, or None where they are more than may be kept."""
        still = self._still.lists
        sizes = np.zeros(len(still.starts) - 1, np.int64)
        sizes[tiles] = (np.diff(still.starts) + np.diff(moving.starts))[tiles]
        starts = np.concatenate([[0], sizes.cumsum()])
        if starts[-1] > self._plan.pair_limit:
            return None
        members = empty(int(starts[-1]), dtype=torch.int32)
        merged = Lists(starts, members, members[:0])

        def work(first: int, last: int) -> None:
            merge_lists(first, last, tiles, still, moving, self._depth, merged)

        parallel_for(work, ranges(len(tiles), stages.TILES_PER_PART))
        return merged

    def _tiles_in(self, rows: tuple[int, int] | None) -> NDArray[np.bool_]:
        grid = self._plan.grid
        if rows is None:
            return np.ones(grid.rows * grid.columns, bool)
        tile_row = np.arange(grid.rows).repeat(grid.columns)
        return (tile_row >= rows[0] >> grid.shift) & (tile_row <= (rows[1] - 1) >> grid.shift)

    def _footprints(self, order: Integers) -> Footprints:
        nothing = np.zeros(SH + 1, np.int64)
        return Footprints(
            prints=self._prints, depth=self._depth, visible=order, order=order, unusable=nothing
        )

    def _raster(self, unusable: NDArray[np.int64]) -> Raster:
        """Copies, because the next image overwrites the planes."""
        image = self._image
        return Raster(
            planes=image.cropped(image.planes)[: self._used].clone(),
            light=image.cropped(image.light)[0].clone(),
            medians=image.cropped(image.medians).clone(),
            unusable=tuple(unusable.tolist()),
        )
