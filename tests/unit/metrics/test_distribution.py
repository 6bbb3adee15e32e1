"""Distances of distributions: against formulas in float64, and at their limits."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError, ShapeError
from diff4splat.metrics.distribution import frechet_distance, kernel_distance
from diff4splat.metrics.jackknife import jackknife_interval


def samples(count: int, features: int, seed: int, scale: float = 1.0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return scale * torch.randn(count, features, generator=generator, dtype=torch.float64)


def frechet_by_roots(one: torch.Tensor, other: torch.Tensor) -> float:
    """The formula with the root of one covariance by its eigenvectors."""
    x, y = one.numpy(), other.numpy()
    a, b = (np.cov(side, rowvar=False) for side in (x, y))
    values, vectors = np.linalg.eigh(a)
    root = vectors @ np.diag(np.sqrt(values.clip(0))) @ vectors.T
    inner = np.linalg.eigvalsh(root @ b @ root).clip(0)
    means = ((x.mean(0) - y.mean(0)) ** 2).sum()
    return float(means + np.trace(a) + np.trace(b) - 2 * np.sqrt(inner).sum())


def kernel_by_loops(one: torch.Tensor, other: torch.Tensor) -> float:
    def k(x: torch.Tensor, y: torch.Tensor) -> float:
        return (float(x @ y) / len(x) + 1) ** 3

    def within(side: torch.Tensor) -> float:
        pairs = [k(x, y) for i, x in enumerate(side) for j, y in enumerate(side) if i != j]
        return math.fsum(pairs) / len(pairs)

    between = [k(x, y) for x in one for y in other]
    return within(one) + within(other) - 2 * math.fsum(between) / len(between)


@pytest.mark.parametrize(("n", "m", "d"), [(50, 40, 5), (6, 9, 30), (30, 4, 8), (2, 2, 3)])
def test_frechet_is_the_formula(n: int, m: int, d: int) -> None:
    one, other = samples(n, d, 1), samples(m, d, 2, 1.5) + 0.3
    assert frechet_distance(one, other) == pytest.approx(frechet_by_roots(one, other), rel=1e-6)


@pytest.mark.parametrize(("n", "m", "d"), [(5, 7, 3), (2, 2, 1), (4, 3, 12)])
def test_kernel_is_the_formula(n: int, m: int, d: int) -> None:
    one, other = samples(n, d, 3), samples(m, d, 4) + 0.5
    assert kernel_distance(one, other) == pytest.approx(kernel_by_loops(one, other), rel=1e-9)


def test_of_one_feature_it_is_that_of_two_normal_distributions() -> None:
    one, other = samples(400, 1, 5), samples(300, 1, 6, 2.0) + 3
    wanted = (one.mean() - other.mean()) ** 2 + (one.std() - other.std()) ** 2
    assert frechet_distance(one, other) == pytest.approx(float(wanted), rel=1e-9)


@pytest.mark.parametrize("count", [2, 3, 20])
def test_equal_sets_are_at_no_distance(count: int) -> None:
    one = samples(count, 50, 7, 1e3)
    assert frechet_distance(one, one) < 1e-6 * float(one.square().sum())
    constant = torch.ones(count, 50)
    assert frechet_distance(constant, constant) == 0
    assert kernel_distance(constant, constant) == pytest.approx(0, abs=1e-12)
    assert frechet_distance(constant, constant + 2) == pytest.approx(200)


def test_the_kernel_distance_is_unbiased_and_finds_a_difference() -> None:
    equal = [kernel_distance(samples(12, 6, s), samples(12, 6, s + 500)) for s in range(300)]
    spread = float(np.std(equal)) / math.sqrt(len(equal))
    assert abs(float(np.mean(equal))) < 3 * spread
    assert kernel_distance(samples(12, 6, 1), samples(12, 6, 2) + 2) > 10 * float(np.std(equal))


def test_pairs_of_one_scene_do_not_bring_distributions_nearer_than_equal() -> None:
    def pair(seed: int) -> tuple[torch.Tensor, torch.Tensor]:
        scene = samples(12, 6, seed)
        return scene + 0.1 * samples(12, 6, seed + 500), scene + 0.1 * samples(12, 6, seed + 900)

    found = [kernel_distance(*pair(seed), paired=True) for seed in range(300)]
    naive = [kernel_distance(*pair(seed)) for seed in range(300)]
    error = float(np.std(found)) / math.sqrt(len(found))
    assert abs(float(np.mean(found))) < 3 * error
    assert float(np.mean(naive)) < -10 * error
    with pytest.raises(ShapeError, match="pairs"):
        kernel_distance(samples(3, 2, 1), samples(4, 2, 1), paired=True)


def test_single_precision_far_from_zero_is_exact() -> None:
    one, other = samples(20, 8, 8), samples(20, 8, 9)
    shifted = frechet_distance((one + 1e3).float(), (other + 1e3).float())
    assert shifted == pytest.approx(frechet_distance(one, other), rel=1e-2)


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 8), st.integers(2, 8), st.integers(1, 12), st.floats(1e-6, 1e6))
def test_frechet_is_symmetric_and_not_negative(n: int, m: int, d: int, scale: float) -> None:
    one, other = samples(n, d, 10, scale), samples(m, d, 11, scale)
    there, back = frechet_distance(one, other), frechet_distance(other, one)
    assert there >= 0
    assert there == pytest.approx(back, rel=1e-6, abs=1e-9 * scale**2)
    assert math.isfinite(kernel_distance(one, other))


@pytest.mark.parametrize("measure", [frechet_distance, kernel_distance])
def test_what_has_no_distance_is_refused(measure) -> None:
    good = samples(4, 3, 1)
    for bad in (good[:1], samples(4, 2, 1), good[:, :0]):
        with pytest.raises(ShapeError, match="at least 2 samples"):
            measure(good, bad)
    with pytest.raises(InputError, match="finite"):
        measure(good, good * math.nan)


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    values = samples(25, 1, 12)[:, 0]
    found = jackknife_interval(lambda index: float(values[list(index)].mean()), 25)
    error = float(values.std()) / 5
    assert found.mean == pytest.approx(float(values.mean()))
    assert found.high - found.low == pytest.approx(2 * 1.959964 * error, rel=1e-6)
    assert math.isnan(jackknife_interval(lambda index: 1.0, 2).low)
