"""The backward pass: packets are traversed again, and sums over rays go to Gaussians.

Only the inputs are saved from the forward pass. Sums over rays run in the order of the parts of
packets, so gradients have the same bits whatever the number of threads.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from queue import SimpleQueue

import numpy as np

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster.padded_image import empty
from diff4splat.render.trace.bvh.boxes import PRIMITIVES_PER_PART
from diff4splat.render.trace.forward import PACKETS_PER_PART
from diff4splat.render.trace.shading.gradient_sums import COLOR, COLUMNS, LOBES, TO_RAY
from diff4splat.render.trace.shading.gradients import add_rows, finish, finish_motion
from diff4splat.render.trace.shading.shade_backward import shade_backward
from diff4splat.render.trace.tables import (
    Cloud,
    Doubles,
    Floats,
    Integers,
    MotionArrays,
    TraceInputs,
)

_LEAST_PARTS, _MOST_PARTS = 4, 64
"""How many parts of packets wait to be added at first, and ever."""

Part = tuple[Integers, Doubles, Floats]
"""Primitives that a part of packets hits, their sums, and those of their harmonics."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gradients:
    """Of everything that went in."""

    cloud: Cloud
    motion: MotionArrays
    plain_colors: Doubles
    """Of the colours without harmonics (n × 3)."""
    lobes: Floats
    """Of the harmonics (n × 3 × 16)."""
    rays: Floats
    """Origins (3), directions (3), times."""


def gradients(
    inputs: TraceInputs, cloud: Cloud, motion: MotionArrays, output_grads: Floats, memory_bytes: int
) -> Gradients:
    """Gradients of all inputs from those of the outputs (r × 7)."""
    count = len(cloud.means)
    totals = np.zeros((count, COLUMNS))
    lobes = np.zeros((count if inputs.bands > 1 else 0, LOBES), np.float32)
    to_rays = empty(len(inputs.rays.origins), TO_RAY)
    for parts in _backward_parts(inputs, output_grads, to_rays, memory_bytes):
        _add(parts, totals, lobes)
    grads = Cloud(*(np.zeros(array.shape, np.float32) for array in cloud))
    motion_grads = MotionArrays(*(np.zeros(array.shape, np.float32) for array in motion))

    def work(first: int, last: int) -> None:
        finish(first, last, cloud, inputs.scene.primitives, totals, grads)
        if len(motion.velocities):
            finish_motion(first, last, inputs.scene.primitives, totals, motion_grads)

    parallel_for(work, ranges(count, PRIMITIVES_PER_PART))
    return Gradients(
        cloud=grads,
        motion=motion_grads,
        plain_colors=totals[:, COLOR : COLOR + 3],
        lobes=lobes,
        rays=to_rays,
    )


def _backward_parts(
    inputs: TraceInputs, output_grads: Floats, to_rays: Floats, memory_bytes: int
) -> Iterator[list[Part]]:
    """Sums of one block of parts after another, as many at once as fit in memory."""
    todo = ranges(len(inputs.rays.starts) - 1, PACKETS_PER_PART)
    pool: SimpleQueue[tuple[Integers, Integers]] = SimpleQueue()
    size, largest = _LEAST_PARTS, 1
    while todo:
        block, todo = todo[:size], todo[size:]
        results: list[Part | None] = [None] * len(block)

        def work(part: int, first: int, last: int, results: list[Part | None] = results) -> None:
            lists = _lists(pool, len(inputs.scene.primitives))
            results[part] = shade_backward(first, last, inputs, output_grads, *lists, to_rays)
            pool.put(lists)

        parallel_for(work, ((number, *part) for number, part in enumerate(block)))
        parts = [part for part in results if part is not None]
        yield parts
        largest = max(largest, *(sum(array.nbytes for array in part) for part in parts))
        size = min(max(memory_bytes // largest, 1), _MOST_PARTS)


def _lists(pool: "SimpleQueue[tuple[Integers, Integers]]", count: int) -> tuple[Integers, Integers]:
    """Lists of rows and of primitives that no other thread uses."""
    if pool.empty():
        return np.full(count, -1, np.int32), np.empty(count, np.int32)
    return pool.get()


def _add(parts: list[Part], totals: Doubles, lobes: Floats) -> None:
    """Add the sums of all parts, in their order, to those of all primitives."""

    def work(low: int, high: int) -> None:
        for listed, sums, own_lobes in parts:
            add_rows(low, high, listed, sums, totals)
            if len(lobes):
                add_rows(low, high, listed, own_lobes, lobes)

    parallel_for(work, ranges(len(totals), max(PRIMITIVES_PER_PART, -(-len(totals) // 8))))
