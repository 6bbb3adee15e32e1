"""Kernel: colours and distances along rays from their hits.

Per ray, over its hits nearest first: w = α T, T ← (1 - α) T; sums are in float64.
"""

import numpy as np

from diff4splat.kernels.addresses import float_at, int_at, word_at
from diff4splat.kernels.jit import inlined
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.shading.sh_color import (
    color,
    color_tables,
    evaluate_sh,
    make_sh_workspace,
)
from diff4splat.render.trace.traversal.intersect import scratch_addresses
from diff4splat.render.trace.traversal.traverse import initial_scratch, traverse_in_parts

RGB, DISTANCE, WEIGHT, LIGHT, MEDIAN, OUTPUT_COLUMNS = 0, 3, 4, 5, 6, 7
"""Columns of the outputs of a ray: rgb (3), Σ w τ, Σ w, light left, median τ."""


@kernel
def shade(first, last, inputs, ray_outputs, hits):
    """Trace packets ``first`` to ``last`` into their rays' rows of ``ray_outputs`` and ``hits``."""
    scratch, workspace, rays = initial_scratch(), make_sh_workspace(), inputs.rays
    tables = color_tables(inputs, workspace)
    for packet in range(first, last):
        place, stop = rays.starts[packet], rays.starts[packet + 1]
        while place < stop:
            end, scratch = traverse_in_parts(inputs, place, stop, scratch)
            at = scratch_addresses(scratch, end - place)
            for lane in range(end - place):
                ray = rays.order[place + lane]
                blended = _blend(at, tables, lane, ray)
                for column in range(OUTPUT_COLUMNS):
                    ray_outputs[ray, column] = blended[column]
                hits[ray] = word_at(at.counts, lane)
            place = end


@inlined
def _blend(at, tables, lane, ray):
    """Outputs of one ray, front to back."""
    red = green = blue = far = weights = median = 0.0
    light, first = 1.0, lane * at.room
    for place in range(first, first + word_at(at.counts, lane)):
        alpha = np.float64(float_at(at.alphas, place))
        distance = np.float64(float_at(at.distances, place))
        i = np.int64(int_at(at.members, int_at(at.ranks, place)))
        if place == first or tables.toward_mean:
            evaluate_sh(tables, i, ray)
        weight = alpha * light
        after = light - weight
        red += weight * max(color(tables, i, 0), 0.0)
        green += weight * max(color(tables, i, 1), 0.0)
        blue += weight * max(color(tables, i, 2), 0.0)
        far += weight * distance
        weights += weight
        if light > 0.5 >= after:
            median = distance
        light = after
    return red, green, blue, far, weights, light, median
