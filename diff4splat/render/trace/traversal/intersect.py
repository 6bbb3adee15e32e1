"""Intersection of sixteen rays at once with one candidate after another; hits stay in order.

In the frame of the packet (see `frame`) a primitive has its mean at (x, y, z), deviation s along
the view, and an upper triangular root of what remains across:

    p = (u11 (X - x) + u12 (Y - y), u22 (Y - y))       (X, Y) where the ray crosses the mean's z
    g = (g1, g2) = s (u13 + u11 slope_x + u12 slope_y, u23 + u22 slope_y)
    D² = (p1² + p2² + (p1 g2 - p2 g1)²) / (1 + g1² + g2²)
    z of the closest point = z - s (p · g) / (1 + g1² + g2²)

which is the canonical-ray formula of `response` after a rotation that makes W triangular.
Lagrange's identity in place of a difference keeps D² of long, thin primitives.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.kernels.addresses import (
    address,
    bits,
    double_at,
    first_bit,
    float_at,
    int_at,
    lanes_at,
    prefetch_at,
    put_double,
    put_float,
    put_int,
    put_lanes,
    put_word,
    word_at,
)
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, any_of, exp2, fill, fma, less_product, minimum
from diff4splat.render.raster.projection.footprint import HALF_LOG2E
from diff4splat.render.trace.tables import MOVING_COLUMNS
from diff4splat.render.trace.traversal.candidates import ORDER_SLACK
from diff4splat.render.trace.traversal.frame import (
    FARTHEST,
    SHIFT_X,
    SHIFT_Y,
    SINCE,
    SLOPE_X,
    SLOPE_Y,
    START,
    STRETCH,
)
from diff4splat.render.trace.traversal.hits import sort_hits, swap
from diff4splat.render.trace.traversal.packet_primitive import (
    G1,
    G1X,
    G1Y,
    G2,
    G2Y,
    INV_TIME_SIGMA,
    LEVEL,
    TIME_OFFSET,
    U11,
    U12,
    U22,
    VX,
    VY,
    VZ,
    S,
    X,
    Y,
    Z,
    put_primitive,
)
from diff4splat.render.trace.traversal.scratch import CHUNK, SHAPE_COLUMNS

_QUARTIC_LOG2E = 2 * HALF_LOG2E / 18
_AHEAD = 8
"""How many candidates ahead primitives are fetched; they lie in memory in any order."""
_ROOM = 1e-5
"""Hits nearer than all that follow, less this part, are settled."""


class ScratchAddresses(NamedTuple):
    """Addresses of the arrays in the scratch."""

    numbers: int
    shapes: int
    lane_distances: int
    lane_alphas: int
    members: int
    depths: int
    distances: int
    alphas: int
    ranks: int
    counts: int
    settled: int
    soonest: int
    light: int
    room: int
    """Hits that fit per ray."""


@inlined
def scratch_addresses(scratch, rays):
    """Addresses of the scratch of a packet of ``rays`` rays."""
    return ScratchAddresses(
        address(scratch.numbers),
        address(scratch.shapes),
        address(scratch.lane_distances),
        address(scratch.lane_alphas),
        address(scratch.members),
        address(scratch.depths),
        address(scratch.distances),
        address(scratch.alphas),
        address(scratch.ranks),
        address(scratch.counts),
        address(scratch.settled),
        address(scratch.soonest),
        address(scratch.light),
        len(scratch.distances) // rays,
    )


@inlined
def intersect_all(scene, frame, rules, scratch, candidate_count, rays):
    """Intersect the ``candidates`` until all ``rays`` are dark; False if hits do not fit.

    Afterwards the hits of every ray are sorted, and end where its light is used up.
    """
    at, lit, first = scratch_addresses(scratch, rays), rays, 0
    table, columns = address(scene.primitives), scene.primitives.shape[1]
    for ray in range(rays):
        put_word(at.counts, ray, 0)
        put_word(at.settled, ray, 0)
        put_double(at.light, ray, 1.0)
        put_float(at.soonest, ray, np.float32(np.inf))
    while first < candidate_count and lit > 0:
        last = min(first + CHUNK, candidate_count)
        for rank in range(first, last):
            ahead = min(rank + _AHEAD, candidate_count - 1)
            prefetch_at(table + 8 * columns * np.int64(int_at(at.members, ahead)))
            row = table + 8 * columns * np.int64(int_at(at.members, rank))
            shape = at.shapes + 4 * SHAPE_COLUMNS * (rank - first)
            put_primitive(shape, row, columns == MOVING_COLUMNS, frame)
        for rank in range(first, last):
            shape = at.shapes + 4 * SHAPE_COLUMNS * (rank - first)
            for lane in range(0, rays, LANES):
                left = _intersect(at, shape, lane, columns == MOVING_COLUMNS, rules)
                while left != 0:
                    bit = first_bit(left)
                    left &= left - 1
                    if not _append(at, lane, bit, rank):
                        return False
        if last < candidate_count:
            following = np.float64(float_at(at.depths, last)) / ORDER_SLACK
            for ray in range(rays):
                if float_at(at.numbers, FARTHEST + ray) > 0 and _is_opaque(
                    at, rules, following, ray
                ):
                    lit -= 1
        first = last
    for ray in range(rays):
        sort_hits(at, ray, rules.dark)
    return True


@inlined
def _intersect(at, shape, lane, moving, rules):
    """Intersect sixteen rays from ``lane`` on with a shape; returns a bit for each hit.

    Distances and alphas of these are left in ``lane_distances`` and ``lane_alphas``.
    """
    numbers = at.numbers + 4 * lane
    alive = lanes_at(numbers, FARTHEST) > 0.0
    if not any_of(alive):
        return 0
    x, y, z = fill(float_at(shape, X)), fill(float_at(shape, Y)), fill(float_at(shape, Z))
    level = fill(float_at(shape, LEVEL))
    if moving:
        since = lanes_at(numbers, SINCE)
        x = fma(since, float_at(shape, VX), x)
        y = fma(since, float_at(shape, VY), y)
        z = fma(since, float_at(shape, VZ), z)
        deviations = fma(since, float_at(shape, INV_TIME_SIGMA), fill(float_at(shape, TIME_OFFSET)))
        level = less_product(level, deviations * deviations, np.float32(HALF_LOG2E))
        alive = alive & (deviations * deviations < np.float32(rules.squared_gate))
    slope_x, slope_y = lanes_at(numbers, SLOPE_X), lanes_at(numbers, SLOPE_Y)
    away_x = fma(z, slope_x, lanes_at(numbers, SHIFT_X)) - x
    away_y = fma(z, slope_y, lanes_at(numbers, SHIFT_Y)) - y
    p1 = fma(away_x, float_at(shape, U11), away_y * float_at(shape, U12))
    p2 = away_y * float_at(shape, U22)
    g1 = fma(slope_y, float_at(shape, G1Y), fill(float_at(shape, G1)))
    g1 = fma(slope_x, float_at(shape, G1X), g1)
    g2 = fma(slope_y, float_at(shape, G2Y), fill(float_at(shape, G2)))
    inverse = fill(1.0) / fma(g1, g1, fma(g2, g2, fill(1.0)))
    twist = less_product(p1 * g2, p2, g1)
    squared = fma(p1, p1, fma(p2, p2, twist * twist)) * inverse
    exponent = _exponent(level, squared, rules)
    along = fma(p1, g1, p2 * g2) * inverse
    depth = less_product(z, along, float_at(shape, S))
    distance = (depth - lanes_at(numbers, START)) * lanes_at(numbers, STRETCH)
    alive = alive & (exponent >= np.float32(rules.log2_cutoff))
    alive = alive & (distance > np.float32(rules.near))
    left = bits(alive & (squared <= np.float32(rules.squared_limit)))
    if left != 0:
        put_lanes(at.lane_distances, 0, distance)
        put_lanes(at.lane_alphas, 0, minimum(exp2(exponent), np.float32(rules.alpha_max)))
    return left


@inlined
def _exponent(level, squared, rules):
    """log2 of α before it is held to the largest."""
    if rules.quartic:
        return less_product(level, squared * squared, np.float32(_QUARTIC_LOG2E))
    return less_product(level, squared, np.float32(HALF_LOG2E))


@inlined
def _append(at, lane, bit, rank):
    """Append a hit to those of its ray; False if it does not fit."""
    count = word_at(at.counts, lane + bit)
    if count == at.room:
        return False
    place, distance = (lane + bit) * at.room + count, float_at(at.lane_distances, bit)
    put_float(at.distances, place, distance)
    put_float(at.alphas, place, float_at(at.lane_alphas, bit))
    put_int(at.ranks, place, np.int32(rank))
    put_word(at.counts, lane + bit, count + 1)
    put_float(at.soonest, lane + bit, min(distance, float_at(at.soonest, lane + bit)))
    return True


@inlined
def _is_opaque(at, rules, following, ray):
    """Whether settled hits, which no later candidate can precede, leave a ray no light.

    Light is a product, so settled hits need no order: they are moved before the others.
    """
    start = np.float64(float_at(at.numbers, START + ray))
    limit = following - start - _ROOM * abs(start)
    limit *= np.float64(float_at(at.numbers, STRETCH + ray)) * (1 - _ROOM)
    first, settled, light = ray * at.room, word_at(at.settled, ray), double_at(at.light, ray)
    if float_at(at.soonest, ray) >= limit:
        return False
    soonest = np.float32(np.inf)
    for place in range(first + settled, first + word_at(at.counts, ray)):
        distance = float_at(at.distances, place)
        if distance < limit:
            light *= 1 - np.float64(float_at(at.alphas, place))
            if place > first + settled:
                swap(at, place, first + settled)
            settled += 1
        else:
            soonest = min(soonest, distance)
    put_word(at.settled, ray, settled)
    put_double(at.light, ray, light)
    put_float(at.soonest, ray, soonest)
    if light < rules.dark:
        put_float(at.numbers, FARTHEST + ray, np.float32(-1))
        return True
    return False
