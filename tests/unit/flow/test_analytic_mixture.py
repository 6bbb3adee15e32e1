import math

import pytest
import torch
from oracles_flow import gaussian_trajectory, mixture_velocity, seeded_normal

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.levels import uniform_levels
from diff4splat.flow.samplers import SAMPLERS, integrate

MEANS, STDS, WEIGHTS = [-1.5, 0.4, 2.0], [0.5, 0.2, 1.0], [0.2, 0.5, 0.3]


def one_dimensional() -> GaussianMixture:
    def column(values: list[float]) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float64)

    return GaussianMixture(
        means=column(MEANS)[:, None],
        stds=column(STDS)[:, None],
        log_weights=column([math.log(w) for w in WEIGHTS]),
    )


@pytest.mark.parametrize("level", [0.05, 0.3, 0.7, 1.0])
def test_velocity_matches_quadrature(level: float) -> None:
    noisy = [-2.0, -0.3, 0.5, 1.7]
    got = one_dimensional().velocity(torch.tensor(noisy, dtype=torch.float64)[:, None], level)
    want = [mixture_velocity(x, level, MEANS, STDS, WEIGHTS) for x in noisy]
    torch.testing.assert_close(got[:, 0], torch.tensor(want, dtype=torch.float64))


def test_one_component_follows_its_closed_trajectory() -> None:
    mixture = GaussianMixture(
        means=torch.full((1, 2), 0.7, dtype=torch.float64),
        stds=torch.full((1, 2), 0.3, dtype=torch.float64),
        log_weights=torch.zeros(1, dtype=torch.float64),
    )
    normal = seeded_normal(5, 2)
    got = integrate(SAMPLERS["midpoint"], mixture.velocity, normal, uniform_levels(400))
    torch.testing.assert_close(got, gaussian_trajectory(0.7, 0.3, normal, 0.0), rtol=0, atol=1e-6)


@pytest.mark.parametrize("std", [0.0, 1e-30, 1e-6, 1e3])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_velocity_and_gradient_stay_finite(std: float, dtype: torch.dtype) -> None:
    for level in (0.0, 1e-6, 0.5, 1.0):
        assert_velocity_finite(std, level, dtype)


def assert_velocity_finite(std: float, level: float, dtype: torch.dtype) -> None:
    mixture = GaussianMixture(
        means=torch.tensor([[0.0, 1.0], [1.0, -1.0]], dtype=dtype),
        stds=torch.full((2, 2), std, dtype=dtype),
        log_weights=torch.zeros(2, dtype=dtype),
    )
    noisy = seeded_normal(3, 2, dtype=dtype).requires_grad_()
    velocity = mixture.velocity(noisy, level)
    velocity.sum().backward()
    assert bool(velocity.isfinite().all())
    assert bool(noisy.grad.isfinite().all())


def test_gradient() -> None:
    noisy = seeded_normal(2, 1).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: one_dimensional().velocity(x, 0.4), (noisy,))


def test_weights_choose_the_component() -> None:
    certain = torch.tensor([-1e4, 0.0, -1e4], dtype=torch.float64)
    only = one_dimensional().with_weights(certain)
    noisy = seeded_normal(4, 1)
    want = [mixture_velocity(float(x), 0.5, MEANS[1:2], STDS[1:2], [1.0]) for x in noisy]
    got = only.velocity(noisy, 0.5)[:, 0]
    torch.testing.assert_close(got, torch.tensor(want, dtype=torch.float64))


def test_random_mixture_is_seeded_and_in_range() -> None:
    mixture = random_mixture(3, components=2, dimensions=5, stds=(0.1, 0.2))
    assert torch.equal(mixture.means, random_mixture(3, components=2, dimensions=5).means)
    assert mixture.means.shape == (2, 5)
    assert float(mixture.stds.min()) >= 0.1
    assert float(mixture.stds.max()) <= 0.2


def test_refuses_what_is_no_mixture(as_shipped: None) -> None:
    ones = torch.ones(2, 3)
    with pytest.raises(ShapeError, match=r"expected means and stds \(k, d\)"):
        GaussianMixture(means=ones, stds=ones, log_weights=torch.zeros(3))
    with pytest.raises(ConfigError, match="stds: expected 0 or above"):
        GaussianMixture(means=ones, stds=-ones, log_weights=torch.zeros(2))
