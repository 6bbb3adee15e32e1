"""Kernel: hits of packets to what their rays see.

Per ray, over its hits nearest first: w = α T, T ← (1 - α) T; sums are in float64.
"""

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.look import begin, look_on
from diff4splat.render.trace.meet import places_of
from diff4splat.render.trace.tint import begin_tint, color, tint_of, turn
from diff4splat.render.trace.vectors import float_at, int_at, word_at

RGB, DISTANCE, WEIGHT, LIGHT, MEDIAN, SEEN = 0, 3, 4, 5, 6, 7
"""Columns of what a ray sees: rgb (3), Σ w τ, Σ w, light left, median τ."""


@kernel
def shade(first, last, sight, seen, hits):
    """Trace packets ``first`` to ``last`` into the rows ``seen`` and ``hits`` of their rays."""
    scratch, brush, rays = begin(), begin_tint(), sight.rays
    tint = tint_of(sight, brush)
    for packet in range(first, last):
        place, stop = rays.starts[packet], rays.starts[packet + 1]
        while place < stop:
            end, scratch = look_on(sight, place, stop, scratch)
            at = places_of(scratch, end - place)
            for lane in range(end - place):
                ray = rays.order[place + lane]
                found = _blend(at, tint, lane, ray)
                for column in range(SEEN):
                    seen[ray, column] = found[column]
                hits[ray] = word_at(at.counts, lane)
            place = end


@inlined
def _blend(at, tint, lane, ray):
    """What one ray sees, front to back."""
    red = green = blue = far = weights = median = 0.0
    light, first = 1.0, lane * at.room
    for place in range(first, first + word_at(at.counts, lane)):
        alpha = np.float64(float_at(at.alphas, place))
        distance = np.float64(float_at(at.distances, place))
        i = np.int64(int_at(at.members, int_at(at.ranks, place)))
        if place == first or tint.toward_mean:
            turn(tint, i, ray)
        weight = alpha * light
        after = light - weight
        red += weight * max(color(tint, i, 0), 0.0)
        green += weight * max(color(tint, i, 1), 0.0)
        blue += weight * max(color(tint, i, 2), 0.0)
        far += weight * distance
        weights += weight
        if light > 0.5 >= after:
            median = distance
        light = after
    return red, green, blue, far, weights, light, median
