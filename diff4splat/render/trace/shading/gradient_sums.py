"""What the gradients of a primitive, and of a ray, are added up in.

Rows are float64 and known by their addresses.
"""

from diff4splat.kernels.addresses import double_at, put_double
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES

A, B, E, LATE_A, LATE_E, LATER_E, COLOR, DIRECT, LATE_DIRECT, COLUMNS = (
    *(0, 3, 9, 10, 13, 14),
    *(15, 18, 21, 24),
)
"""Columns of a primitive, as in `pull`: A (3), B (11, 12, 13, 22, 23, 33), Σ e; with the time since
the centre of the pulse A (3), e, and e once more; colour (3); the mean through the direction of the
colour (3), and the same with the time."""
LOBES = 3 * LANES
"""Columns of its harmonics."""
TO_ORIGIN, TO_DIRECTION, TO_TIME, TO_RAY = 0, 3, 6, 7
"""Columns of a ray."""


@inlined
def add(row, column, value):
    """Add to one column."""
    put_double(row, column, double_at(row, column) + value)


@inlined
def add_three(row, column, values, factor):
    """Add to three columns."""
    add(row, column, factor * values[0])
    add(row, column + 1, factor * values[1])
    add(row, column + 2, factor * values[2])


@inlined
def three_at(row, column):
    """Three neighbouring columns."""
    return double_at(row, column), double_at(row, column + 1), double_at(row, column + 2)
