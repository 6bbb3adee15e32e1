"""The fit against its formula: exact lines, outliers, and data that no line explains."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.alignment.__main__ import METHODS, relative_errors
from benchmarks.alignment.scenes import make_scene
from diff4splat.data_prep.alignment.disparity_fit import fit_disparity, weighted_line
from diff4splat.data_prep.alignment.other_fits import grid_regions, paper_depth_space
from diff4splat.data_prep.alignment.samples import (
    FitSamples,
    SampleSettings,
    candidate_pixels,
    choose_samples,
)
from diff4splat.errors import InputError


def line_data(scale: float, shift: float, count: int = 400, seed: int = 0):
    inverse = 1 / np.random.default_rng(seed).uniform(1, 30, count)
    return (inverse - shift) / scale, inverse


@given(
    scale=st.floats(1e-4, 1e4),
    shift=st.floats(-0.03, 0.03),
    outliers=st.floats(0, 0.4),
    seed=st.integers(0, 100),
)
@settings(max_examples=25, deadline=None)
def test_exact_lines_are_found_among_outliers(scale, shift, outliers, seed) -> None:
    disparity, inverse = line_data(scale, shift, seed=seed)
    wrong = np.random.default_rng(seed).random(len(inverse)) < outliers
    given_inverse = np.where(wrong, inverse * 2.5, inverse)
    fit = fit_disparity(disparity, given_inverse)
    assert fit.scale == pytest.approx(scale, rel=1e-6)
    assert fit.shift == pytest.approx(shift, abs=1e-7)
    assert fit.inlier_share == pytest.approx(1 - wrong.mean())
    assert fit.relative_error < 1e-6


def test_depth_in_place_of_disparity_is_refused() -> None:
    _, inverse = line_data(1, 0)
    with pytest.raises(InputError, match="depth instead of disparity"):
        fit_disparity(1 / inverse, inverse)


@pytest.mark.parametrize("disparity", [np.full(50, 0.3), np.zeros(1)])
def test_disparity_without_variation_is_refused(disparity) -> None:
    with pytest.raises(InputError, match="alignment: expected"):
        fit_disparity(disparity, np.linspace(0.1, 1, len(disparity)))


def test_a_weighted_line_is_least_squares() -> None:
    rng = np.random.default_rng(1)
    x, y, w = rng.random((3, 40))
    design = np.c_[x, np.ones(40)] * np.sqrt(w)[:, None]
    expected = np.linalg.lstsq(design, y * np.sqrt(w), rcond=None)[0]
    np.testing.assert_allclose(weighted_line(x, y, w), expected, rtol=1e-10)


def test_sky_and_moving_outliers_stay_below_six_percent() -> None:
    methods = list(METHODS)
    for kind in ("indoor", "outdoor"):
        errors = relative_errors(make_scene(kind, 0.2, 0.25, 0.1, 3), masked=False)
        robust = errors[methods.index("RANSAC + IRLS")]
        assert robust <= 0.06
        assert errors[methods.index("least squares")] > 2 * robust
        assert errors[methods.index("paper's Algorithm 1, depth")] > 2 * robust


def test_the_papers_fit_is_exact_without_a_shift_and_wrong_with_one() -> None:
    for shift, is_exact in ((0.0, True), (0.02, False)):
        disparity, inverse = line_data(0.01, shift)
        samples = FitSamples(
            disparity=disparity,
            inverse_depth=inverse,
            frame=np.zeros(len(inverse), np.int64),
            pixel=np.arange(len(inverse)),
        )
        fit = paper_depth_space(samples, grid_regions(samples, (20, 20)))
        error = np.median(np.abs((fit.scale / disparity + fit.shift) * inverse - 1))
        assert bool(error < 1e-9) == is_exact


def test_samples_are_spread_over_log_depth() -> None:
    depth = np.full((1, 100, 100), 2.0, np.float32)
    depth[0, :, 90:] = 40.0
    settings_few = SampleSettings(most=1000, depth_bins=4)
    samples = choose_samples(1 / depth, depth, np.ones(depth.shape, bool), settings_few)
    assert len(samples.disparity) == 1000
    assert (samples.inverse_depth < 0.1).sum() == 500


def test_excluded_infinite_and_edge_pixels_are_no_samples() -> None:
    depth = np.full((1, 4, 6), 3.0, np.float32)
    depth[0, :, 3:] = 5.0
    disparity = 1 / depth
    disparity[0, 0, 0] = np.nan
    depth[0, 1, 0] = np.inf
    excluded = np.zeros(depth.shape, bool)
    excluded[0, 2, 0] = True
    usable = candidate_pixels(disparity, depth, excluded, SampleSettings())
    assert not usable[0, :3, 0].any()
    assert not usable[0, :, 2:4].any()
    assert usable[0, 3, 0]
    assert usable[0, :, 5].all()


def test_no_mask_of_a_fit_undoes_another() -> None:
    """A public pipeline replaces the mask of sky by the one that it computes last."""
    rng = np.random.default_rng(3)
    depth = np.full((2, 24, 24), 5.0)
    disparity = 1 / depth
    excluded = np.zeros(depth.shape, bool)
    excluded[:, :12] = rng.random((2, 12, 24)) < 0.5
    depth[:, 12:15] = np.nan
    disparity[:, 15:17] = 0
    depth[:, 18:20] = 500.0
    disparity[:, :, 12:] *= 2
    found = candidate_pixels(disparity, depth, excluded, SampleSettings())
    wrong = excluded | ~np.isfinite(depth) | (disparity == 0) | (depth > 80)
    wrong[:, :, 11:13] = True
    assert found.any() and not found[wrong].any()
