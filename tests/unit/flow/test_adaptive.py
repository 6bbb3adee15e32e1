"""The tolerance is held, calls are bounded, and both ends are finite."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import gaussian_trajectory, seeded_normal

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.flow.adaptive import StepControl, integrate_adaptively
from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.levels import log_snr_levels
from diff4splat.flow.samplers import SAMPLERS, integrate


def gaussian(std: float, dimensions: int = 4) -> GaussianMixture:
    shape = (1, dimensions)
    return GaussianMixture(
        means=torch.full(shape, 0.7, dtype=torch.float64),
        stds=torch.full(shape, std, dtype=torch.float64),
        log_weights=torch.zeros(1, dtype=torch.float64),
    )


def error_of(tolerance: float) -> tuple[float, int]:
    """Largest RMS end-point error over trajectories of one Gaussian, and the calls."""
    start = seeded_normal(8, 4)
    got = integrate_adaptively(gaussian(0.3).velocity, start, StepControl(tolerance=tolerance))
    wrong = got.state - gaussian_trajectory(0.7, 0.3, start, 0.0)
    return float(wrong.square().mean(1).max().sqrt()), got.calls


def test_smaller_tolerances_cost_calls_and_give_smaller_errors() -> None:
    measured = [error_of(tolerance) for tolerance in (1e-1, 1e-2, 1e-3, 1e-4)]
    errors, calls = zip(*measured, strict=True)
    assert list(errors) == sorted(errors, reverse=True)
    assert list(calls) == sorted(calls)
    # The estimate is of one step; all steps together stay within a few of them.
    assert all(
        error < 8 * tolerance
        for error, tolerance in zip(errors, (1e-1, 1e-2, 1e-3, 1e-4), strict=True)
    )


def test_needs_fewer_calls_than_euler_for_its_error_on_a_stiff_mixture() -> None:
    mixture, start = random_mixture(1, dimensions=24), seeded_normal(32, 24, seed=7)
    fine = integrate(SAMPLERS["unipc"], mixture.velocity, start, log_snr_levels(400))
    got = integrate_adaptively(mixture.velocity, start, StepControl(tolerance=0.03))
    euler = integrate(SAMPLERS["euler"], mixture.velocity, start, log_snr_levels(3 * got.calls))
    median = [float((end - fine).norm(dim=1).median()) for end in (got.state, euler)]
    assert median[0] < median[1]


@settings(max_examples=25, deadline=None)
@given(
    log_std=st.floats(-6, 2),
    log_tolerance=st.floats(-6, 0),
    calls=st.integers(2, 40),
    last=st.sampled_from([0.0, 0.02, 0.3]),
)
def test_calls_are_bounded_and_ends_finite(
    log_std: float, log_tolerance: float, calls: int, last: float
) -> None:
    control = StepControl(tolerance=10**log_tolerance, max_calls=calls, last_level=last)
    got = integrate_adaptively(gaussian(10**log_std).velocity, seeded_normal(2, 4), control)
    assert got.calls <= calls
    assert bool(got.state.isfinite().all())
    assert (got.levels[0], got.levels[-1]) == (1.0, 0.0)
    assert all(after < before for before, after in zip(got.levels, got.levels[1:], strict=False))
    assert last == 0 or got.levels[-2] >= last


def test_a_promise_that_the_calls_broke_is_said() -> None:
    control = StepControl(tolerance=1e-9, max_calls=8)
    got = integrate_adaptively(gaussian(0.3).velocity, seeded_normal(2, 4), control)
    assert got.largest_error > control.tolerance


def test_the_worst_frame_counts() -> None:
    """One moving frame among sixteen static ones has the error that it has alone."""
    start = seeded_normal(1, 4)
    field, other = gaussian(0.3).velocity, seeded_normal(1, 4, seed=1)

    def video(state: torch.Tensor, level: float) -> torch.Tensor:
        moving = field(state[:, :, 0], level)
        return torch.stack([moving, *[torch.zeros_like(other)] * 16], 2)

    alone = integrate_adaptively(field, start, StepControl(tolerance=1e-2))
    control = StepControl(tolerance=1e-2, kept_axes=(0, 2))
    noise = torch.stack([start, *[other] * 16], 2)
    got = integrate_adaptively(video, noise, control)
    # A frame with velocity 0 changes its clean prediction nowhere.
    assert got.levels == alone.levels
    torch.testing.assert_close(got.state[:, :, 0], alone.state)


def test_half_precision_continues_in_float32() -> None:
    got = integrate_adaptively(
        lambda state, level: state.bfloat16(), torch.ones(1, 2).bfloat16(), StepControl()
    )
    assert got.state.dtype == torch.float32


def test_gradient() -> None:
    start = (0.1 * seeded_normal(1, 2)).requires_grad_()
    control = StepControl(tolerance=0.05)
    assert torch.autograd.gradcheck(
        lambda x: integrate_adaptively(lambda s, t: s.square(), x, control).state, (start,)
    )


def test_progress_counts_the_steps_taken() -> None:
    ticks = []
    got = integrate_adaptively(
        gaussian(0.3).velocity, seeded_normal(2, 4), StepControl(), lambda: ticks.append(1)
    )
    assert len(ticks) == len(got.levels) - 1
    assert got.calls == len(ticks) + got.rejected


def test_a_velocity_that_is_never_finite_ends_too() -> None:
    got = integrate_adaptively(
        lambda state, level: state * float("nan"), torch.ones(1, 2), StepControl(max_calls=20)
    )
    assert got.calls <= 20
    assert not bool(got.state.isfinite().any())


@pytest.mark.parametrize(
    "wrong",
    [{"tolerance": 0.0}, {"tolerance": float("nan")}, {"max_calls": 1}, {"last_level": 1.0}],
)
def test_refuses(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="expected"):
        StepControl(**wrong)


def test_refuses_whole_numbers(as_shipped: None) -> None:
    with pytest.raises(ShapeError, match="floating-point"):
        integrate_adaptively(lambda s, t: s, torch.ones(1, 1, dtype=torch.long), StepControl())
