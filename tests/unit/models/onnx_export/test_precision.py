"""Weights in eight bits: the bound of the error, zeros, and which weights are converted."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from diff4splat.errors import ConfigError
from diff4splat.models.onnx_export.precision import convert_precision, quantized

NUMBERS = st.floats(-1e6, 1e6, width=32)


@example(np.full((3, 4, 2), 4.08e-43, np.float32), 0)
@given(arrays.arrays(np.float32, (3, 4, 2), elements=NUMBERS), st.integers(0, 2))
def test_the_error_is_at_most_half_a_step(values: np.ndarray, axis: int) -> None:
    whole, scale = quantized(values, axis)
    shape = [-1 if other == axis else 1 for other in range(3)]
    step = scale.reshape(shape)
    assert whole.dtype == np.int8 and np.isfinite(scale).all() and (scale > 0).all()
    assert (np.abs(whole * step - values) <= step * (0.5 + 1e-4)).all()


def test_zeros_stay_zeros() -> None:
    whole, scale = quantized(np.zeros((2, 3), np.float32), 0)
    assert not whole.any() and (scale == 1).all()


def test_an_unknown_precision(tmp_path) -> None:
    with pytest.raises(ConfigError, match="expected one of float32, float16, int8, int8-dynamic"):
        convert_precision(tmp_path / "graph.onnx", "int3")
