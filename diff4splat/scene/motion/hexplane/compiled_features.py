"""Features of points as one differentiable operation on float32 CPU tensors.

Axes: ``n`` points, ``t`` times, ``c`` channels, ``f`` features of all levels. The same numbers as
``sampling`` gives, to rounding, in a fraction of the time. Reading is split over points; gradients
over levels and groups of sixteen channels, so that no two threads write one plane's number.
"""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

from diff4splat.kernels.parallel import parallel_for
from diff4splat.kernels.simd16 import LANES
from diff4splat.scene.motion.hexplane.kernels import Floats, Planes, Shape, accumulate, read

POINTS_AT_ONCE = 2048


def features(unit: Float[Tensor, "n 3"], tables: list[Tensor]) -> Float[Tensor, "t n f"]:
    """Features at ``unit`` places; six ``tables`` per level, each ``r r c``.

    They are the planes xy, xz, yz and the lines ``t r c`` along x, y and z.
    """
    return _Features.apply(unit, *tables)


class _Features(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, unit: Tensor, *tables: Tensor) -> Tensor:
        unit, *tables = (tensor.detach().contiguous() for tensor in (unit, *tables))
        ctx.save_for_backward(unit, *tables)
        shapes = _shapes(unit, tables)
        made = unit.new_empty(shapes[0].times, len(unit), shapes[0].features)
        places, values, flat = _flat(unit), _levels(tables), _flat(made)
        parts = [
            (first, min(first + POINTS_AT_ONCE, len(unit)), places, values[k], shape, flat)
            for first in range(0, len(unit), POINTS_AT_ONCE)
            for k, shape in _numbered(shapes, tables)
        ]
        parallel_for(read, parts)
        return made

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, incoming: Tensor) -> tuple[Tensor, ...]:
        unit, *tables = ctx.saved_tensors
        shapes = _shapes(unit, tables)
        made = [torch.zeros_like(table) for table in tables]
        to_unit = unit.new_empty(len(shapes), len(unit), 3)
        places, values, out = _flat(unit), _levels(tables), _levels(made)
        given = _flat(incoming.contiguous())
        parts = [
            (places, values[k], shape, given, out[k], _flat(part))
            for (k, shape), part in zip(_numbered(shapes, tables), to_unit, strict=True)
        ]
        parallel_for(accumulate, parts)
        return to_unit.sum(0), *made


def _flat(tensor: Tensor) -> Floats:
    return tensor.detach().numpy().reshape(-1)


def _levels(tables: list[Tensor]) -> list[Planes]:
    arrays = [_flat(table) for table in tables]
    return [Planes(*arrays[k : k + 6]) for k in range(0, len(arrays), 6)]


def _shapes(unit: Tensor, tables: list[Tensor]) -> list[Shape]:
    """One per level and group of channels, level by level."""
    channels = tables[0].shape[-1]
    made = []
    for level in range(0, len(tables), 6):
        xy, xz, _, lines, *_ = tables[level : level + 6]
        for channel in range(0, channels, LANES):
            made.append(
                Shape(
                    x=xy.shape[1], y=xy.shape[0], z=xz.shape[0], times=lines.shape[0],
                    points=len(unit), channels=channels, channel=channel,
                    features=len(tables) // 6 * channels, feature=level // 6 * channels + channel,
                )
            )  # fmt: skip
    return made


def _numbered(shapes: list[Shape], tables: list[Tensor]) -> list[tuple[int, Shape]]:
    """Each with the number of its level."""
    groups = len(shapes) // (len(tables) // 6)
    return [(k // groups, shape) for k, shape in enumerate(shapes)]
