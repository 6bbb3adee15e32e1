"""The way back of one ray that meets one primitive.

With p the closest point and g the ray in canonical space, τ where they meet, q = |p|² = D², and
e, f the gradients in ln α and τ, the chain ends in a vector and a symmetric matrix, as p ⊥ g:

    A = 2 (∂L/∂q) p - f g / |g|²        B = 2 (∂L/∂q) p pᵀ - f (g pᵀ + p gᵀ) / |g|²
    ∂L/∂mean = -Wᵀ A    ∂L/∂W = B S Rᵀ    ∂L/∂origin = Wᵀ A
    ∂L/∂direction = Wᵀ (2 (∂L/∂q) τ p - f (p + τ g) / |g|²)

Sums of A, B and e over rays are all that a primitive needs.
"""

import numpy as np

from diff4splat.kernels.addresses import double_at, float_at
from diff4splat.kernels.jit import inlined
from diff4splat.render.trace.shading.gradient_sums import (
    LATE_A,
    LATE_E,
    LATER_E,
    TO_DIRECTION,
    TO_ORIGIN,
    TO_TIME,
    A,
    B,
    E,
    add,
    add_three,
    three_at,
)
from diff4splat.render.trace.shading.sh_color import triple_at
from diff4splat.render.trace.tables import (
    CENTER,
    INV_TIME_SIGMA,
    MEAN,
    MOVING_COLUMNS,
    VELOCITY,
    WHITEN,
)
from diff4splat.render.trace.traversal.frame import dot, minus, plus


@inlined
def intersect_backward(tables, quartic, i, ray, slopes, row, ray_row):
    """Add what primitive ``i`` and ``ray`` do to a meeting with ``slopes`` (e, f) to their rows."""
    e, f = slopes
    table = tables.table + 8 * tables.columns * i
    since = _since(tables, table, ray)
    offset = minus(triple_at(tables.origins, ray), three_at(table, MEAN))
    if tables.columns == MOVING_COLUMNS:
        offset = plus(offset, three_at(table, VELOCITY), -since)
    w1, w2, w3 = three_at(table, WHITEN), three_at(table, WHITEN + 3), three_at(table, WHITEN + 6)
    direction = triple_at(tables.directions, ray)
    start = (dot(w1, offset), dot(w2, offset), dot(w3, offset))
    g = (dot(w1, direction), dot(w2, direction), dot(w3, direction))
    distance = -dot(start, g) / dot(g, g)
    p, share = plus(start, g, distance), f / dot(g, g)
    # 2 ∂L/∂q
    slope = -e * 2 * dot(p, p) / 9 if quartic else -e
    a = (slope * p[0] - share * g[0], slope * p[1] - share * g[1], slope * p[2] - share * g[2])
    _add_shape(row, a, slope, share, p, g)
    add(row, E, e)
    # distance · A, less the part of f that p has in the direction alone.
    to_origin = _transposed(w1, w2, w3, a)
    add_three(ray_row, TO_ORIGIN, to_origin, 1.0)
    add_three(ray_row, TO_DIRECTION, to_origin, distance)
    add_three(ray_row, TO_DIRECTION, _transposed(w1, w2, w3, p), -share)
    if tables.columns == MOVING_COLUMNS:
        add_three(row, LATE_A, a, since)
        add(row, LATE_E, since * e)
        add(row, LATER_E, since * since * e)
        inv_sigma = double_at(table, INV_TIME_SIGMA)
        add(ray_row, TO_TIME, -dot(three_at(table, VELOCITY), to_origin) - e * since * inv_sigma**2)


@inlined
def _since(tables, table, ray):
    """Time of a ray since the centre of a pulse."""
    if tables.columns < MOVING_COLUMNS:
        return 0.0
    return np.float64(float_at(tables.times, ray)) - double_at(table, CENTER)


@inlined
def _transposed(w1, w2, w3, v):
    """Wᵀ v."""
    return (
        w1[0] * v[0] + w2[0] * v[1] + w3[0] * v[2],
        w1[1] * v[0] + w2[1] * v[1] + w3[1] * v[2],
        w1[2] * v[0] + w2[2] * v[1] + w3[2] * v[2],
    )


@inlined
def _add_shape(row, a, slope, share, p, g):
    """A and B of one meeting."""
    add_three(row, A, a, 1.0)
    add(row, B, (slope * p[0] - 2 * share * g[0]) * p[0])
    add(row, B + 1, slope * p[0] * p[1] - share * (g[0] * p[1] + p[0] * g[1]))
    add(row, B + 2, slope * p[0] * p[2] - share * (g[0] * p[2] + p[0] * g[2]))
    add(row, B + 3, (slope * p[1] - 2 * share * g[1]) * p[1])
    add(row, B + 4, slope * p[1] * p[2] - share * (g[1] * p[2] + p[1] * g[2]))
    add(row, B + 5, (slope * p[2] - 2 * share * g[2]) * p[2])
