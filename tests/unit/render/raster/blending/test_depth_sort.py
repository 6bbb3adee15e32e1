"""The radix sort against NumPy's stable sort."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from diff4splat.render.raster.blending.depth_sort import depth_sort

FLOAT32 = np.float32
DEPTHS = st.floats(FLOAT32(1e-30), FLOAT32(1e30), width=32)
FEW = st.sampled_from([0.1, 0.5, 1.0, 1.0000001, 3.5, 1e-45, 3e38])


def assert_sorted(depth: np.ndarray, visible: np.ndarray) -> None:
    want = visible[np.argsort(depth[visible], kind="stable")]
    got = depth_sort(visible, depth)
    assert got.dtype == np.int32
    np.testing.assert_array_equal(got, want)


def everything(depth: np.ndarray) -> np.ndarray:
    return np.arange(len(depth), dtype=np.int32)


@settings(max_examples=50, deadline=None)
@given(hnp.arrays(FLOAT32, st.integers(1, 60), elements=DEPTHS))
def test_any_depths(depth: np.ndarray) -> None:
    assert_sorted(depth, everything(depth))


@settings(max_examples=50, deadline=None)
@given(hnp.arrays(FLOAT32, st.integers(1, 200), elements=FEW))
def test_equal_depths_keep_their_order(depth: np.ndarray) -> None:
    assert_sorted(depth, everything(depth))


@settings(max_examples=25, deadline=None)
@given(hnp.arrays(FLOAT32, st.integers(1, 60), elements=DEPTHS), st.integers(0, 2**20))
def test_only_some_are_visible(depth: np.ndarray, seed: int) -> None:
    chosen = np.random.default_rng(seed).random(len(depth)) < 0.5
    # What cannot be seen has no depth.
    depth[~chosen] = np.nan
    assert_sorted(depth, everything(depth)[chosen])


@pytest.mark.parametrize("spread", [0.0, 1e-7, 1e-4, 1e-2, 1.0, 1e10])
def test_as_many_digits_as_the_depths_need(spread: float) -> None:
    depth = (1 + spread * np.random.default_rng(0).random(5000)).astype(FLOAT32)
    assert_sorted(depth, everything(depth))


def test_the_largest_spread_there_is() -> None:
    bits = np.random.default_rng(0).integers(1, 0x7F7FFFFF, 5000, dtype=np.uint32)
    bits[:2] = 1, 0x7F7FFFFF
    assert_sorted(bits.view(FLOAT32), everything(bits))


def test_nothing_and_one() -> None:
    assert len(depth_sort(np.empty(0, np.int32), np.empty(0, FLOAT32))) == 0
    assert depth_sort(np.array([3], np.int32), np.ones(5, FLOAT32)).tolist() == [3]
