"""Front-to-back compositing of footprints, tile by tile, in bounded memory.

Axes: ``n`` Gaussians nearest first, ``b`` tiles, ``l`` list length, ``k`` a piece of it, ``p`` the
pixels of a tile, ``c`` channels, ``f`` columns of a table row. Per pixel, with q the Mahalanobis
distance:

    α_i = min(α_max, o_i exp(-q_i / 2)), 0 below the cutoff        w_i = α_i Π_{j<i} (1 - α_j)

and the image is Σ w_i v_i for every channel v. Lists are worked off in pieces that carry the
light still left, so memory does not grow with their length; with gradients each piece is computed
again on the backward pass (torch.utils.checkpoint).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import pad, threshold
from torch.utils.checkpoint import checkpoint

from diff4splat.geometry.rays import pixel_centers
from diff4splat.render.projection import Footprints
from diff4splat.render.settings import RenderSettings
from diff4splat.render.support import pixel_boxes
from diff4splat.render.tiling import Region, batches, grid_size, regions, tile_boxes

DEFAULT_TILE_PX = 8
_LIVE_BUFFERS = 16
"""Arrays of one value per tile, Gaussian and pixel that are alive at once, with their gradients."""
_BYTES_PER_PAIR = 256
"""Integers and table rows that a pair (tile, Gaussian) takes while its region is worked on."""
_CPU_VALUES = 1 << 18
"""Values per buffer beyond which a piece falls out of a CPU's cache."""
_LEADING = 7
"""Columns of a table row before the channels: centre (2), whitening (3), opacity, z."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Composite:
    """What an image is made of before the background."""

    blended: Float[Tensor, "h w c"]
    """Sum of weight times channel."""
    median_depth: Float[Tensor, "h w"]
    """z where the light falls to one half; zeros unless asked for."""
    light: Float[Tensor, "h w"]
    """How much of what lies behind is seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plan:
    """What stays the same from tile to tile."""

    table: Float[Tensor, "n f"]
    """One row per Gaussian; one more, of opacity 0, pads the lists."""
    boxes: Int[Tensor, "m 4"]
    """The tiles that each Gaussian touches."""
    grid: tuple[int, int]
    settings: RenderSettings
    medians: bool

    @property
    def tile_px(self) -> int:
        """Edge of a tile."""
        return self.settings.tile_px or DEFAULT_TILE_PX

    @property
    def piece_pairs(self) -> int:
        """How many pairs (tile, Gaussian) are blended at once."""
        values = self.settings.memory_bytes // (_LIVE_BUFFERS * self.table.element_size())
        if self.table.device.type == "cpu":
            values = min(values, _CPU_VALUES)
        return max(1, values // self.tile_px**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tiles:
    """Tiles that are done."""

    numbers: Int[Tensor, " b"]
    values: Float[Tensor, "b p c"]
    """Blended channels, median depth, light."""


def composite(
    prints: Footprints,
    channels: Float[Tensor, "n c"],
    size_px: tuple[int, int],
    settings: RenderSettings,
    medians: bool,
) -> Composite:
    """Blend ``channels`` of footprints in depth order; ``medians`` also finds the median depth."""
    columns = [prints.center_px, prints.whitening, prints.opacities[:, None], prints.depth[:, None]]
    tile_px = settings.tile_px or DEFAULT_TILE_PX
    plan = _Plan(
        table=pad(torch.cat([*columns, channels], 1), (0, 0, 0, 1)),
        boxes=tile_boxes(pixel_boxes(prints, size_px, settings.alpha_cutoff), tile_px),
        grid=grid_size(size_px, tile_px),
        settings=settings,
        medians=medians,
    )
    parts = regions(plan.boxes, plan.grid, settings.memory_bytes // _BYTES_PER_PAIR)
    # What one region keeps for the backward pass fits in memory; what several keep need not.
    blend = _blend_region if len(parts) == 1 else _forgetful(_blend_region, plan)
    image = _assemble(plan, [blend(plan, part) for part in parts])
    image = image[: size_px[0], : size_px[1]]
    return Composite(blended=image[..., :-2], median_depth=image[..., -2], light=image[..., -1])


def _forgetful(function: Callable[..., Any], plan: _Plan) -> Callable[..., Any]:
    """``function``, keeping only its arguments for the backward pass."""
    if not (torch.is_grad_enabled() and plan.table.requires_grad):
        return function
    return lambda *args: checkpoint(function, *args, use_reentrant=False, preserve_rng_state=False)


def _blend_region(plan: _Plan, region: Region) -> _Tiles:
    """The tiles of ``region`` that are not empty."""
    lists = batches(plan.boxes, region, plan.grid[1], plan.piece_pairs)
    members = [part.members.flatten() for part in lists]
    # One gather for all: its gradient is one scatter into the table, in a fixed order.
    rows = plan.table.index_select(0, torch.cat([plan.boxes.new_zeros(0), *members]))
    values = [_nothing(plan, 0)]
    for part, own in zip(lists, rows.split([len(part) for part in members]), strict=True):
        values.append(_blend_tiles(plan, part.tiles, own.unflatten(0, part.members.shape)))
    numbers = [plan.boxes.new_zeros(0), *(part.tiles for part in lists)]
    return _Tiles(numbers=torch.cat(numbers), values=torch.cat(values))


def _blend_tiles(
    plan: _Plan, numbers: Int[Tensor, " b"], rows: Float[Tensor, "b l f"]
) -> Float[Tensor, "b p c"]:
    """Channels, median depth and light of tiles with lists of one length."""
    edge = plan.tile_px
    corner_px = torch.stack([numbers % plan.grid[1], numbers // plan.grid[1]], -1) * edge
    pixels = corner_px[:, None] + pixel_centers((edge, edge), rows).flatten(0, 1)
    sums, light = _nothing(plan, len(numbers)).mT.split([rows.shape[2] - _LEADING + 1, 1], 1)
    blend = _forgetful(_blend_piece, plan)
    for piece in rows.split(max(1, plan.piece_pairs // len(numbers)), 1):
        part, light = blend(plan, piece, pixels, light)
        sums = sums + part
    return torch.cat([sums, light], 1).mT


def _blend_piece(
    plan: _Plan,
    rows: Float[Tensor, "b k f"],
    pixels: Float[Tensor, "b p 2"],
    light: Float[Tensor, "b 1 p"],
) -> tuple[Float[Tensor, "b c p"], Float[Tensor, "b 1 p"]]:
    """Channels and median depth of Gaussians that ``light`` falls on, and the light behind them."""
    alphas = _alphas(plan.settings, rows, pixels)
    passed = torch.cat([light, 1 - alphas], 1).cumprod(1)
    before, after = passed[:, :-1], passed[:, 1:]
    blended = rows[..., _LEADING:].mT @ (alphas * before)
    median = torch.zeros_like(light)
    if plan.medians:
        halfway = (before > 0.5) & (after <= 0.5)
        median = rows[..., _LEADING - 1 : _LEADING].mT @ halfway.to(rows)
    return torch.cat([blended, median], 1), after[:, -1:]


def _alphas(
    settings: RenderSettings, rows: Float[Tensor, "b k f"], pixels: Float[Tensor, "b p 2"]
) -> Float[Tensor, "b k p"]:
    """Opacity of every Gaussian of a list at every pixel."""
    x, y, inverse_sigma_x, slope, inverse_sigma_y, opacity = rows[..., :6, None].unbind(2)
    dx, dy = pixels[:, None, :, 0] - x, pixels[:, None, :, 1] - y
    u, v = dx * inverse_sigma_x, (dy - slope * dx) * inverse_sigma_y
    alphas = (opacity * torch.exp(-0.5 * (u * u + v * v))).clamp(max=settings.alpha_max)
    # threshold keeps what is strictly larger, and the cutoff itself shall stay.
    cutoff = alphas.new_tensor(settings.alpha_cutoff)
    return threshold(alphas, float(cutoff.nextafter(torch.zeros_like(cutoff))), 0.0)


def _nothing(plan: _Plan, count: int) -> Float[Tensor, "b p c"]:
    """``count`` tiles that no Gaussian touches: all light passes."""
    dark = plan.table.shape[1] - _LEADING + 1
    empty = plan.table.new_zeros(count, plan.tile_px**2, dark)
    return pad(empty, (0, 1), value=1.0)


def _assemble(plan: _Plan, done: list[_Tiles]) -> Float[Tensor, "h w c"]:
    """Put tiles in their places and empty ones in between."""
    (rows, columns), edge = plan.grid, plan.tile_px
    values = torch.cat([_nothing(plan, 1), *(tiles.values for tiles in done)])
    numbers = torch.cat([tiles.numbers for tiles in done])
    rank = torch.arange(1, len(values), device=numbers.device)
    place = numbers.new_zeros(rows * columns).index_copy(0, numbers, rank)
    image = values.index_select(0, place).view(rows, columns, edge, edge, -1)
    return image.transpose(1, 2).flatten(2, 3).flatten(0, 1)
