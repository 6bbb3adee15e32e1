"""Features of points on six planes, in PyTorch operations: any precision, any device.

Axes: ``n`` points, ``t`` times, ``c`` channels, ``f`` those of all levels; planes are ``rj ri c``.
The product of the three planes without time is formed once for all times, and a plane with time is
first interpolated to the line of each time, which all points share.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

AXES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Column and row axis of each plane: xy, xz, xt, yz, yt, zt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where points lie along one axis: between two nodes."""

    lower: Int[Tensor, " n"]
    upper: Int[Tensor, " n"]
    weight: Float[Tensor, "n 1"]
    """Of the upper node, in [0, 1]."""


def features(
    levels: Sequence[tuple[Tensor, ...]], unit: Float[Tensor, "n 3"], rows: Sequence[float]
) -> Float[Tensor, "t n f"]:
    """Concatenated features of all levels; ``unit`` and ``rows`` run from 0 to 1 over the nodes."""
    tables = [table for level in levels for table in at_times(level, rows)]
    if _compiles(unit, tables):
        from diff4splat.scene.motion.hexplane import compiled_features as compiled

        return compiled.features(unit, tables)
    return plain_features(unit, tables)


def at_times(level: tuple[Tensor, ...], rows: Sequence[float]) -> list[Tensor]:
    """The planes xy, xz, yz of a level, and its lines ``t r c`` along x, y and z."""
    xy, xz, xt, yz, yt, zt = level
    last = xt.shape[0] - 1
    # A hat around each time: one matrix product for all times, and one for all their gradients.
    nodes = torch.arange(last + 1, dtype=torch.float64)
    times = torch.tensor(rows, dtype=torch.float64)[:, None] * last
    hats = (1 - (times - nodes).abs()).clamp_min(0).to(xt)
    lines = [(hats @ plane.flatten(1)).unflatten(1, plane.shape[1:]) for plane in (xt, yt, zt)]
    return [xy, xz, yz, *lines]


def plain_features(unit: Float[Tensor, "n 3"], tables: list[Tensor]) -> Float[Tensor, "t n f"]:
    """Features in PyTorch operations; six ``tables`` per level, as ``at_times`` gives them."""
    levels = [tables[k : k + 6] for k in range(0, len(tables), 6)]
    return torch.cat([_level_features(unit, *level) for level in levels], -1)


def _compiles(unit: Tensor, tables: list[Tensor]) -> bool:
    """Whether kernels can take these: float32 on a CPU, in whole groups of channels."""
    tensors = [unit, *tables]
    fits = all(t.dtype == torch.float32 and t.device.type == "cpu" for t in tensors)
    return fits and tables[0].shape[-1] % 16 == 0


def _level_features(
    unit: Float[Tensor, "n 3"], xy: Tensor, xz: Tensor, yz: Tensor, *lines: Tensor
) -> Float[Tensor, "t n c"]:
    nodes = (xy.shape[1], xy.shape[0], xz.shape[0])
    x, y, z = (_place(unit[:, axis], count) for axis, count in enumerate(nodes))
    still = _bilinear(xy, x, y) * _bilinear(xz, x, z) * _bilinear(yz, y, z)
    along_x, along_y, along_z = (_linear(*pair) for pair in zip(lines, (x, y, z), strict=True))
    return still * along_x * along_y * along_z


def _place(unit: Float[Tensor, " n"], nodes: int) -> Place:
    position = (unit * (nodes - 1)).clamp(0, nodes - 1)
    # NaN stays NaN in the weight, and must not become an index.
    lower = position.detach().nan_to_num(0.0).long().clamp(0, max(nodes - 2, 0))
    upper = (lower + 1).clamp_max(nodes - 1)
    return Place(lower=lower, upper=upper, weight=(position - lower)[:, None])


def _linear(lines: Float[Tensor, "t r c"], place: Place) -> Float[Tensor, "t n c"]:
    low, high = lines.index_select(1, place.lower), lines.index_select(1, place.upper)
    return low + place.weight * (high - low)


def _bilinear(plane: Float[Tensor, "rj ri c"], column: Place, row: Place) -> Float[Tensor, "n c"]:
    flat, width = plane.flatten(0, 1), plane.shape[1]

    def along(start: Int[Tensor, " n"]) -> Float[Tensor, "n c"]:
        low = flat.index_select(0, start * width + column.lower)
        high = flat.index_select(0, start * width + column.upper)
        return low + column.weight * (high - low)

    low, high = along(row.lower), along(row.upper)
    return low + row.weight * (high - low)
