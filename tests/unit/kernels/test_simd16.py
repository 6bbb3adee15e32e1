"""Sixteen lanes at once against the same arithmetic in NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numba import njit

from diff4splat.kernels import simd16 as ops
from diff4splat.kernels.simd_memory import (
    aligned_floats,
    block_columns,
    block_rows,
    load,
    load_block,
    prefetch,
    store,
    store_block,
    store_eight,
)

LANES = ops.LANES
FLOAT32 = np.float32
EPS = float(np.finfo(FLOAT32).eps)
any_of, count, exp2, fill, fma = ops.any_of, ops.count, ops.exp2, ops.fill, ops.fma
less_product, minimum, select, total = ops.less_product, ops.minimum, ops.select, ops.total
totals = ops.totals
# Multiples of 1/128: float64 holds their products and sums exactly.
EXACT = st.integers(-12_800, 12_800).map(lambda number: number / 128)
SIXTEEN = hnp.arrays(FLOAT32, LANES, elements=EXACT)


@njit(error_model="numpy")
def powers(numbers, out):
    for start in range(0, len(numbers), LANES):
        store(out, start, exp2(load(numbers, start)))


@njit(error_model="numpy")
def arithmetic(x, y, scalar, out):
    """One row per operation, then how many lanes compare and whether any does."""
    a, b = load(x, 0), load(y, 0)
    store(out, 0, a + b)
    store(out, 16, a - b)
    store(out, 32, a * b)
    store(out, 48, a / b)
    store(out, 64, fma(a, b, scalar))
    store(out, 80, less_product(a, b, scalar))
    store(out, 96, minimum(a, b))
    store(out, 112, minimum(a, scalar))
    store(out, 128, select(a < b, a, 0.0))
    store(out, 144, select((a >= 0.0) & (b > scalar), fill(1.0), b))
    store(out, 160, scalar - a)
    store(out, 176, select(a <= b, b, a))
    return (
        (count(a < b), count(a <= fill(x[0])), count((a >= b) & (a <= b))),
        (any_of(a < b), any_of(a > 1000.0), any_of(a >= 1e30)),
        total(a),
    )


def exp2_in_lanes(numbers: np.ndarray) -> np.ndarray:
    out = np.empty_like(numbers)
    powers(numbers, out)
    return out


def test_powers_of_two_are_right_to_a_few_units_in_the_last_place() -> None:
    numbers = np.linspace(-126, 127, 1 << 20, endpoint=False, dtype=FLOAT32)
    want = np.exp2(numbers.astype(np.float64))
    error = exp2_in_lanes(numbers) / want - 1
    assert np.abs(error).max() <= 3e-7
    # An error of one sign would darken or brighten every image.
    assert abs(error.mean()) <= 3e-8


@pytest.mark.parametrize("edge", [-126.0, -0.5, 0.5, 1.5, 2.5, 126.5, 127.0])
def test_powers_of_two_at_the_seams(edge: float) -> None:
    below, above = np.nextafter(FLOAT32(edge), [FLOAT32(-999), FLOAT32(999)], dtype=FLOAT32)
    numbers = np.array([below, edge, above] + [0.0] * 13, FLOAT32)[[1, 2, 0, *range(3, 16)]]
    numbers = np.maximum(numbers, FLOAT32(-126))
    np.testing.assert_allclose(exp2_in_lanes(numbers), np.exp2(numbers.astype(float)), rtol=3e-7)


@settings(max_examples=25, deadline=None)
@given(SIXTEEN, SIXTEEN, EXACT)
def test_operations_lane_by_lane(x: np.ndarray, y: np.ndarray, scalar: float) -> None:
    y[y == 0] = 1
    out, spread = np.empty(12 * LANES, FLOAT32), FLOAT32(scalar)
    counts, found, added = arithmetic(x, y, scalar, out)
    wide, other = x.astype(np.float64), y.astype(np.float64)
    want = [
        x + y,
        x - y,
        x * y,
        x / y,
        (wide * other + float(spread)).astype(FLOAT32),
        (wide - other * float(spread)).astype(FLOAT32),
        np.minimum(x, y),
        np.minimum(x, spread),
        np.where(x < y, x, 0),
        np.where((x >= 0) & (y > spread), 1, y),
        spread - x,
        np.maximum(x, y),
    ]
    # The sum of a product is rounded twice here where it falls between two float64 numbers.
    twice, rows = [4, 5], out.reshape(12, LANES)
    once = np.setdiff1d(np.arange(12), twice)
    np.testing.assert_array_equal(rows[once], np.array(want, FLOAT32)[once])
    np.testing.assert_allclose(rows[twice], np.array(want, FLOAT32)[twice], rtol=EPS)
    assert counts == (np.sum(x < y), np.sum(x <= x[0]), np.sum(x == y))
    assert found == (bool(np.any(x < y)), False, False)
    assert abs(added - wide.sum()) <= 4 * EPS * np.abs(wide).sum()


def test_the_sum_of_lanes_is_a_balanced_tree() -> None:
    x, out = np.zeros(LANES, FLOAT32), np.empty(12 * LANES, FLOAT32)
    x[0], x[8], x[1] = 1e8, -1e8, 1
    # Halves first: the large ones meet before the small one is lost.
    assert arithmetic(x, x + 1, 0.0, out)[2] == 1.0
    x[8], x[2] = 0, -1e8
    assert arithmetic(x, x + 1, 0.0, out)[2] == 1.0
    x[2], x[1], x[9] = 0, -1e8, 1
    assert arithmetic(x, x + 1, 0.0, out)[2] == 0.0


@njit(error_model="numpy")
def eight_totals(x, out):
    store_eight(
        out, 3, totals(
            load(x, 0), load(x, 16), load(x, 32), load(x, 48),
            load(x, 64), load(x, 80), load(x, 96), load(x, 112),
        ),
    )  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(hnp.arrays(FLOAT32, 8 * LANES, elements=st.floats(-100, 100, width=32)))
def test_eight_sums_at_once(x: np.ndarray) -> None:
    out = np.full(14, 7, FLOAT32)
    eight_totals(x, out)
    wide = x.reshape(8, LANES).astype(np.float64)
    assert bool((np.abs(out[3:11] - wide.sum(1)) <= 4 * EPS * np.abs(wide).sum(1)).all())
    # Only eight are written.
    assert out[:3].tolist() + out[11:].tolist() == [7] * 6


def test_comparisons_with_nan_are_false() -> None:
    x, out = np.full(LANES, np.nan, FLOAT32), np.empty(12 * LANES, FLOAT32)
    counts, found, _ = arithmetic(x, np.ones(LANES, FLOAT32), 1.0, out)
    assert counts == (0, 0, 0)
    assert not any(found)


def test_whole_powers_are_exact() -> None:
    numbers = np.arange(-120, 120, dtype=FLOAT32)
    np.testing.assert_array_equal(exp2_in_lanes(numbers), np.exp2(numbers))


@njit
def through_blocks(image, offset, pitch, out):
    prefetch(image.reshape(-1, 8), 1)
    block = load_block(image, offset, pitch)
    store(out, 0, block)
    store(out, LANES, block_columns())
    store(out, 2 * LANES, block_rows())
    store_block(image, offset, pitch, block + 100.0)


def test_a_block_is_eight_columns_by_two_rows() -> None:
    image, out = np.arange(64 * 4, dtype=FLOAT32), np.empty(3 * LANES, FLOAT32)
    before = image.copy().reshape(4, 64)
    through_blocks(image, 64 + 24, 64, out)
    block, columns, rows = out.reshape(3, 2, 8)
    np.testing.assert_array_equal(block, before[1:3, 24:32])
    np.testing.assert_array_equal(columns, np.tile(np.arange(8), (2, 1)))
    np.testing.assert_array_equal(rows, np.repeat([[0], [1]], 8, axis=1))
    before[1:3, 24:32] += 100
    np.testing.assert_array_equal(image.reshape(4, 64), before)


@njit
def address(size):
    made = aligned_floats(size)
    made[:] = 1
    return made.ctypes.data, len(made)


@pytest.mark.parametrize("size", [0, 1, 16, 1000])
def test_scratch_begins_on_a_cache_line(size: int) -> None:
    place, length = address(size)
    assert place % 64 == 0
    assert length == size
