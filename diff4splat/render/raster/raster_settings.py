"""Settings of one image as kernels read them, from `RenderSettings` and the camera."""

import math
from dataclasses import dataclass

from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.projection import GUARD_BAND
from diff4splat.render.raster.tables import Grid, Rules, View
from diff4splat.render.settings import RenderSettings

TILE_SIZES_PX = (8, 16, 32, 64)
DEFAULT_TILE_PX = 32
DEFAULT_LIGHT_CUTOFF = 1e-6
"""Divided by 1 - alpha_max it bounds what gradients lose: a thousandth."""
_BYTES_PER_PAIR, _BYTES_PER_CHANNEL = 64, 4
_MOST_PAIRS = (1 << 31) - 1
_LEAST_EXPONENT = -125.0
"""Smaller powers of 2 are no normal numbers in float32."""
_LARGEST_ALPHA = 1 - 2.0**-24
"""In float32; the backward pass divides light by 1 - alpha."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterSettings:
    """Settings of one image."""

    grid: Grid
    rules: Rules
    colors: bool
    """Blend RGB from the harmonics, before any extra channels."""
    medians: bool
    pair_limit: int
    """How many pairs (tile, Gaussian) may be kept at once."""


def make_raster_settings(
    camera: Camera, settings: RenderSettings, colors: bool, medians: bool, extras: int = 0
) -> RasterSettings:
    """Settings of an image of ``camera``'s size, with ``extras`` channels after the colours."""
    bytes_per_pair = _BYTES_PER_PAIR + _BYTES_PER_CHANNEL * extras
    return RasterSettings(
        grid=_grid(camera.size_px, settings.tile_px or DEFAULT_TILE_PX),
        # Integers would compile every kernel again.
        rules=Rules(
            dilation_px2=float(settings.added_px2),
            antialias=bool(settings.antialias),
            log2_cutoff=max(math.log2(settings.alpha_cutoff), _LEAST_EXPONENT),
            alpha_max=min(float(settings.alpha_max), _LARGEST_ALPHA),
            light_cutoff=float(settings.light_cutoff or DEFAULT_LIGHT_CUTOFF),
            near_depth=float(settings.near_depth),
        ),
        colors=colors,
        medians=medians,
        pair_limit=min(settings.memory_bytes // bytes_per_pair, _MOST_PAIRS),
    )


def make_view(grid: Grid, pose: Tensor, focal_px: Tensor, center_px: Tensor) -> View:
    """A camera as kernels read it."""
    (focal_x, focal_y), (center_x, center_y) = focal_px.tolist(), center_px.tolist()
    width, height = float(grid.width), float(grid.height)
    return View(
        rotation=tuple(map(tuple, pose[:3, :3].tolist())),
        position=tuple(pose[:3, 3].tolist()),
        focal_x=focal_x,
        focal_y=focal_y,
        center_x=center_x,
        center_y=center_y,
        limits_x=_limits(width, center_x, focal_x),
        limits_y=_limits(height, center_y, focal_y),
        width=width,
        height=height,
    )


def _grid(size_px: tuple[int, int], edge: int) -> Grid:
    height, width = size_px
    columns, rows = -(-width // edge), -(-height // edge)
    return Grid(edge, edge.bit_length() - 1, columns, rows, width, height)


def _limits(size: float, center: float, focal: float) -> tuple[float, float]:
    """Tangents at the image's sides, moved out by the guard band."""
    return (-GUARD_BAND * size - center) / focal, ((1 + GUARD_BAND) * size - center) / focal
