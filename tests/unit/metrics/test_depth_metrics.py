import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.metrics.depth import (
    depth_pearson,
    relative_error,
)

F64 = torch.float64


def maps() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Depth, truth and mask; what is hidden is NaN."""
    depth, truth = torch.rand(2, 2, 5, 6, dtype=F64) * 4 + 0.5
    valid = torch.rand(2, 5, 6) < 0.7
    depth[~valid] = math.nan
    truth[~valid] = math.nan
    return depth, truth, valid


def per_map(function, *tensors: torch.Tensor) -> list[float]:
    depth, truth, valid = (tensor.numpy() for tensor in tensors)
    return [function(depth[b][valid[b]], truth[b][valid[b]]) for b in range(len(depth))]


def test_correlation_against_numpy() -> None:
    three = maps()
    expected = per_map(lambda d, t: np.corrcoef(d, t)[0, 1], *three)
    np.testing.assert_allclose(depth_pearson(*three), expected, rtol=1e-12)


def test_errors_against_numpy() -> None:
    three = maps()
    expected = per_map(lambda d, t: np.mean(np.abs(d - t) / t), *three)
    np.testing.assert_allclose(relative_error(*three), expected, rtol=1e-12)


def test_a_map_that_says_nothing_is_nan() -> None:
    depth, truth = torch.rand(2, 3, 4, 4) + 1
    depth[0], truth[1] = 2.0, 3.0
    valid = torch.ones(3, 4, 4, dtype=torch.bool)
    valid[2] = False
    correlation = depth_pearson(depth, truth, valid)
    assert correlation.isnan().all()
    assert relative_error(depth, truth, valid).isnan().tolist() == [False, False, True]


def test_half_precision_is_widened() -> None:
    depth, truth, valid = maps()
    for measure in (depth_pearson, relative_error):
        assert measure(depth.half(), truth.half(), valid).dtype == torch.float32


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_shapes() -> None:
    depth, truth, valid = maps()
    with pytest.raises(ShapeError, match=r"depth: expected \(2, 5, 6\), got \(1, 5, 6\)"):
        relative_error(depth[:1], truth, valid)
    with pytest.raises(ShapeError, match=r"valid: expected \(2, 5, 6\) bool, got .* float64"):
        relative_error(depth, truth, truth)


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-6, 1e6), shift=st.floats(0, 100))
def test_correlation_knows_neither_scale_nor_shift(scale: float, shift: float) -> None:
    _, truth, valid = maps()
    correlation = depth_pearson(scale * (truth + shift), truth, valid)
    np.testing.assert_allclose(correlation, [1, 1], rtol=1e-6)
