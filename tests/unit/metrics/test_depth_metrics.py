import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.metrics.depth import (
    align_depth,
    depth_pearson,
    relative_error,
    share_within,
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
    expected = per_map(lambda d, t: np.mean(np.maximum(d / t, t / d) < 1.25), *three)
    np.testing.assert_allclose(share_within(*three), expected, rtol=1e-12)


def test_alignments_against_numpy() -> None:
    depth, truth, valid = maps()

    def lower_median(values: np.ndarray) -> float:
        return np.sort(values)[(len(values) - 1) // 2]

    scales = per_map(lambda d, t: lower_median(t) / lower_median(d), depth, truth, valid)
    aligned = align_depth(depth, truth, valid, "median")
    fits = per_map(lambda d, t: np.polyfit(d, t, 1), depth, truth, valid)
    fitted = align_depth(depth, truth, valid, "affine")
    for b in range(2):
        keep = valid[b]
        torch.testing.assert_close(aligned[b][keep], depth[b][keep] * scales[b])
        expected = depth[b][keep] * fits[b][0] + fits[b][1]
        torch.testing.assert_close(fitted[b][keep], expected)
    torch.testing.assert_close(
        align_depth(depth, truth, valid, "none"), depth, rtol=0, atol=0, equal_nan=True
    )


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-6, 1e6), shift=st.floats(0, 100))
def test_what_alignment_removes(scale: float, shift: float) -> None:
    _, truth, valid = maps()
    depth = scale * (truth + shift)
    affine = align_depth(depth, truth, valid, "affine")
    assert float(relative_error(affine, truth, valid).max()) < 1e-6
    median = align_depth(scale * truth, truth, valid, "median")
    assert float(relative_error(median, truth, valid).max()) < 1e-9
    assert share_within(median, truth, valid).tolist() == [1, 1]
    np.testing.assert_allclose(depth_pearson(depth, truth, valid), [1, 1], rtol=1e-6)


def test_a_map_that_says_nothing_is_nan() -> None:
    depth, truth = torch.rand(2, 3, 4, 4) + 1
    depth[0], truth[1] = 2.0, 3.0
    valid = torch.ones(3, 4, 4, dtype=torch.bool)
    valid[2] = False
    correlation = depth_pearson(depth, truth, valid)
    assert correlation.isnan().all()
    for measure in (relative_error, share_within):
        assert measure(depth, truth, valid).isnan().tolist() == [False, False, True]


@pytest.mark.parametrize("alignment", ["median", "affine"])
@pytest.mark.parametrize("shape", [(2, 3, 3), (0, 3, 3), (2, 0, 3)])
def test_maps_that_cannot_be_aligned_stay_finite(alignment, shape: tuple[int, ...]) -> None:
    depth, truth = torch.zeros(shape), torch.ones(shape)
    for valid in (torch.ones(shape).bool(), torch.zeros(shape).bool()):
        assert align_depth(depth, truth, valid, alignment).isfinite().all()


def test_a_flat_map_gets_the_best_shift() -> None:
    truth, valid = torch.rand(1, 4, 4, dtype=F64), torch.ones(1, 4, 4, dtype=torch.bool)
    aligned = align_depth(torch.full_like(truth, 7.0), truth, valid, "affine")
    torch.testing.assert_close(aligned, truth.mean().expand(1, 4, 4))


def test_depth_behind_or_on_the_camera_is_never_within() -> None:
    truth, valid = torch.ones(1, 1, 3), torch.ones(1, 1, 3, dtype=torch.bool)
    assert float(share_within(torch.tensor([[[0.0, -1.0, math.inf]]]), truth, valid)) == 0


def test_half_precision_is_widened() -> None:
    depth, truth, valid = maps()
    for measure in (depth_pearson, relative_error, share_within):
        assert measure(depth.half(), truth.half(), valid).dtype == torch.float32


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_shapes() -> None:
    depth, truth, valid = maps()
    with pytest.raises(ConfigError, match="expected one of none, median, affine, got 'scale'"):
        align_depth(depth, truth, valid, "scale")
    with pytest.raises(ConfigError, match=r"ratio: expected a number above 1, got 1\.0"):
        share_within(depth, truth, valid, 1.0)
    with pytest.raises(ShapeError, match=r"depth: expected \(2, 5, 6\), got \(1, 5, 6\)"):
        relative_error(depth[:1], truth, valid)
    with pytest.raises(ShapeError, match=r"valid: expected \(2, 5, 6\) bool, got .* float64"):
        relative_error(depth, truth, truth)
