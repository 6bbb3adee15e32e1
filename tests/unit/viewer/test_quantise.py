"""Numbers in few bytes, decoded here by other means than the page's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from diff4splat.viewer.quantise import (
    LOG_SCALE_STEPS,
    byte_planes,
    float24,
    log_scales,
    range16,
    smallest_three,
)

FINITE = st.floats(-(2.0**100), 2.0**100, width=32)


def from_float24(data: bytes) -> np.ndarray:
    planes = np.frombuffer(data, np.uint8).reshape(3, -1)
    raw = np.zeros((planes.shape[1], 4), np.uint8)
    raw[:, 1:] = planes.T
    return raw.view("<f4")[:, 0]


def from_smallest_three(packed: np.ndarray) -> np.ndarray:
    quats = np.zeros((len(packed), 4))
    for row, word in enumerate(packed.tolist()):
        largest, others = word >> 30, [(word >> 10 * place) & 1023 for place in range(3)]
        small = [(value / 1023 * 2 - 1) / np.sqrt(2) for value in others]
        quats[row] = np.insert(small, largest, np.sqrt(max(0.0, 1 - sum(v * v for v in small))))
    return quats


@given(arrays(np.float32, st.integers(0, 20), elements=FINITE))
def test_floats_keep_sixteen_bits(values: np.ndarray) -> None:
    found = from_float24(float24(values))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, values, rtol=2**-16, atol=1e-37)


def test_the_largest_float_does_not_overflow() -> None:
    largest = np.array([np.finfo(np.float32).max, -np.finfo(np.float32).max], np.float32)
    np.testing.assert_allclose(from_float24(float24(largest)), largest, rtol=2**-15)


@given(arrays(np.float32, (7, 4), elements=st.floats(-1, 1, width=32)))
def test_rotations_are_kept_to_six_thousandths(quats: np.ndarray) -> None:
    length = np.linalg.norm(quats.astype(float), axis=1, keepdims=True)
    unit = np.where(length > 0, quats / np.where(length > 0, length, 1), [1.0, 0, 0, 0])
    found = from_smallest_three(smallest_three(quats))
    # A quaternion and its negative are one rotation.
    cosine = np.abs((found * unit).sum(1))
    assert (2 * np.arccos(np.clip(cosine, -1, 1)) < 6e-3).all()


@given(arrays(np.float32, (2, 3), elements=FINITE))
def test_sixteen_bits_span_the_values(values: np.ndarray) -> None:
    found = range16(values)
    error = np.abs(found.values * found.step - values.astype(np.float64))
    assert (error <= 0.5001 * found.step).all()
    assert np.isfinite(found.step) and found.step > 0


@pytest.mark.parametrize("scale", [0.0, 1e-38, 1e-6, 1.0, 1e6, 1e30])
def test_sizes_are_kept_to_a_thousandth(scale: float) -> None:
    found = np.exp(log_scales(np.array([scale], np.float32))[0] / LOG_SCALE_STEPS)
    if 1e-13 < scale < 1e13:
        assert found == pytest.approx(scale, rel=1e-3)
    else:
        assert np.isfinite(found) and found > 0


def test_planes_hold_one_byte_of_every_value() -> None:
    assert byte_planes(np.array([0x0102, 0x0304], np.uint16)) == bytes([2, 4, 1, 3])
    assert byte_planes(np.zeros((0, 3), np.int16)) == b""
