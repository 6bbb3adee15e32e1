"""Velocity, pulse and colour waves."""

import math
from dataclasses import fields, replace

import oracles_spacetime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_spacetime import motion, still_gaussians

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion

F64 = torch.float64
EXTREMES = [1e-38, 1e-6, 1.0, 1e6, 1e38, math.inf]


def assert_same(left: Gaussians, right: Gaussians) -> None:
    for field in fields(Gaussians):
        torch.testing.assert_close(getattr(left, field.name), getattr(right, field.name))


def pulses(deviations: list[float], dtype: torch.dtype = torch.float32) -> SpacetimeMotion:
    """Gaussians that differ in the length of their pulse alone, with centre 0.5 s."""
    count = len(deviations)
    return SpacetimeMotion(
        moving_index=torch.arange(count),
        velocities=torch.ones(count, 3, dtype=dtype),
        time_centers_s=torch.full((count,), 0.5, dtype=dtype),
        time_deviations_s=torch.tensor(deviations, dtype=dtype),
        time_range_s=(0.0, 1.0),
        color_waves=torch.ones(count, 2, 1, 3, dtype=dtype),
    )


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 999), time_s=st.floats(0.0, 2.0))
def test_the_state_is_that_of_the_formula(seed: int, time_s: float) -> None:
    still, moving = still_gaussians(5, seed=seed), motion([0, 2, 3], seed)
    state = moving.state_at(still, time_s)
    for row, index in enumerate([0, 2, 3]):
        elapsed = time_s - float(moving.time_centers_s[row])
        variance = float(moving.time_deviations_s[row]) ** 2
        pulse = math.exp(-0.5 * elapsed**2 / variance)
        pulse = pulse if pulse > 0.05 else 0.0
        mean = still.means[index] + moving.velocities[row] * elapsed
        orders = torch.cat([still.sh[index][None], moving.color_waves[row]]).numpy()
        sh = torch.from_numpy(oracles_spacetime.harmonics_at(orders, elapsed, 1.7))
        torch.testing.assert_close(state.means[index], mean)
        torch.testing.assert_close(state.opacities[index], still.opacities[index] * pulse)
        torch.testing.assert_close(state.sh[index], sh)
    others = torch.tensor([1, 4])
    assert_same(state.select(others), still.select(others))
    assert state.quats is still.quats
    assert state.scales is still.scales


def test_at_its_centre_a_gaussian_is_the_canonical_one_with_all_its_waves() -> None:
    still, moving = still_gaussians(1), motion([0], waves=0)
    moving = replace(moving, time_centers_s=torch.tensor([0.75], dtype=F64))
    assert_same(moving.state_at(still, 0.75), still)


def test_nothing_changes_outside_the_time_range() -> None:
    still, moving = still_gaussians(4), motion([0, 1, 3])
    assert_same(moving.state_at(still, -7.0), moving.state_at(still, 0.0))
    assert_same(moving.state_at(still, 9.0), moving.state_at(still, 2.0))
    assert not bool(moving.velocity_at(still, 2.1).any())
    assert not bool(moving.velocity_at(still, -0.1).any())


def test_velocity_is_the_derivative_of_the_mean() -> None:
    still, moving = still_gaussians(4), motion([1, 3])
    step = 1e-3
    change = moving.state_at(still, 0.8 + step).means - moving.state_at(still, 0.8 - step).means
    torch.testing.assert_close(moving.velocity_at(still, 0.8), change / (2 * step))
    assert not bool(moving.velocity_at(still, 0.8)[[0, 2]].any())


def test_a_gaussian_is_there_within_2_448_deviations_and_nowhere_else() -> None:
    still = still_gaussians(1)
    moving = replace(
        motion([0]),
        time_centers_s=torch.tensor([1.0], dtype=F64),
        time_deviations_s=torch.tensor([0.1], dtype=F64),
    )
    reach_s = 0.1 * math.sqrt(-2 * math.log(0.05))
    assert reach_s == pytest.approx(0.2448, abs=1e-4)
    for sign in (-1, 1):
        assert float(moving.state_at(still, 1 + sign * (reach_s + 1e-9)).opacities) == 0
        inside = float(moving.state_at(still, 1 + sign * (reach_s - 1e-9)).opacities)
        assert inside == pytest.approx(0.05 * float(still.opacities), rel=1e-6)
    open_gate = replace(moving, gate=0.0)
    assert float(open_gate.pulse_at(0.0)) == pytest.approx(math.exp(-50))


def test_the_wave_of_order_one_flips_after_half_a_period() -> None:
    still, moving = still_gaussians(1), motion([0], waves=1)
    moving = replace(moving, time_centers_s=torch.tensor([0.0], dtype=F64), period_s=2.0)
    for time_s, sign in ((0.0, 1), (0.5, 0), (1.0, -1), (2.0, 1)):
        change = moving.state_at(still, time_s).sh - still.sh
        torch.testing.assert_close(change, sign * moving.color_waves[:, 0])


def test_waves_are_even_in_the_time_from_the_centre() -> None:
    still = still_gaussians(1)
    moving = replace(motion([0]), time_centers_s=torch.tensor([1.0], dtype=F64))
    torch.testing.assert_close(moving.state_at(still, 0.7).sh, moving.state_at(still, 1.3).sh)


def test_colours_add_up_per_direction() -> None:
    """The colour of the state is the sum of the colours of all orders, harmonic by harmonic."""
    still, moving = still_gaussians(3, bands=16), motion([0, 1, 2], bands=16)
    directions = torch.nn.functional.normalize(still.means, dim=-1)
    values = harmonics.basis(directions, 3)
    orders = torch.cat([still.sh[:, None], moving.color_waves], 1)
    elapsed = 0.4 - moving.time_centers_s
    cosines = torch.stack([(2 * math.pi * n * elapsed / 1.7).cos() for n in range(3)], -1)
    want = 0.5 + torch.einsum("no,nk,nokc->nc", cosines, values, orders)
    got = harmonics.color(moving.state_at(still, 0.4).sh, directions)
    torch.testing.assert_close(got, want.clamp_min(0))


def test_selecting_commutes_with_moving() -> None:
    still, moving = still_gaussians(6), motion([1, 3, 4])
    kept = torch.tensor([True, False, True, True, False, True])
    assert_same(
        moving.select(kept).state_at(still.select(kept), 0.4),
        moving.state_at(still, 0.4).select(kept),
    )


def test_casts_keep_the_index_and_the_settings() -> None:
    moving = motion([1, 3]).to(torch.float32)
    assert moving.velocities.dtype == moving.color_waves.dtype == torch.float32
    assert moving.moving_index.dtype == torch.long
    assert moving.period_s == 1.7
    assert moving.to(torch.device("cpu")).moving_index.tolist() == [1, 3]
    assert motion([1], waves=0).to(torch.float32).color_waves is None


def test_nobody_moving_and_nobody_at_all() -> None:
    still = still_gaussians(2)
    assert motion([]).state_at(still, 0.3) is still
    assert not bool(motion([]).velocity_at(still, 0.3).any())
    nobody = still_gaussians(0)
    assert len(motion([]).state_at(nobody, 0.3)) == 0
    assert isinstance(motion([0]), Motion)


@pytest.mark.parametrize("waves", [0, 1, 2])
def test_states_are_differentiable(waves: int) -> None:
    still, moving = still_gaussians(3), motion([0, 2], waves=waves)
    moving = replace(moving, gate=0.0)
    names = ["velocities", "time_centers_s", "time_deviations_s", *["color_waves"][: min(waves, 1)]]

    def state(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        at = replace(moving, **dict(zip(names, values, strict=True))).state_at(still, 0.3)
        return at.means, at.opacities, at.sh

    inputs = [getattr(moving, name).clone().requires_grad_() for name in names]
    assert torch.autograd.gradcheck(state, inputs)


def test_the_gate_keeps_the_gradient_inside_and_has_none_outside() -> None:
    moving = pulses([0.3, 0.1], F64)
    deviations = moving.time_deviations_s.clone().requires_grad_()
    replace(moving, time_deviations_s=deviations).pulse_at(0.1).sum().backward()
    inside = math.exp(-0.5 * (0.4 / 0.3) ** 2) * 0.4**2 / 0.3**3
    assert deviations.grad.tolist() == pytest.approx([inside, 0.0])


@pytest.mark.parametrize("gate", [0.0, 0.05, 0.999])
@pytest.mark.parametrize("time_s", [0.0, 0.5, 0.5000001, 1.0])
@pytest.mark.parametrize("dtype", [torch.float32, F64])
def test_extreme_pulses_stay_finite(gate: float, time_s: float, dtype: torch.dtype) -> None:
    moving = replace(pulses(EXTREMES, dtype), gate=gate)
    names = ("velocities", "time_centers_s", "time_deviations_s", "color_waves")
    leaves = {name: getattr(moving, name).clone().requires_grad_() for name in names}
    state = replace(moving, **leaves).state_at(still_gaussians(6, bands=1).to(dtype), time_s)
    (state.means.sum() + state.opacities.sum() + state.sh.sum()).backward()
    for value in (state.means, state.opacities, state.sh, *(leaf.grad for leaf in leaves.values())):
        assert bool(torch.isfinite(value).all())
    always = still_gaussians(6, bands=1).to(dtype).opacities[-1]
    assert float(state.opacities[-1].detach()) == float(always)
    if time_s in (0.0, 1.0):
        assert state.opacities[:2].tolist() == [0, 0]


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"velocities": torch.zeros(3, 3)}, ShapeError, r"velocities: expected \(2, 3\)"),
        ({"time_centers_s": torch.zeros(1)}, ShapeError, r"time_centers_s: expected \(2,\)"),
        ({"time_deviations_s": torch.ones(2, 1)}, ShapeError, "time_deviations_s: expected"),
        ({"color_waves": torch.zeros(2, 3, 4, 3)}, ShapeError, "color_waves: expected"),
        ({"color_waves": torch.zeros(2, 4, 3)}, ShapeError, "color_waves: expected"),
        ({"moving_index": torch.tensor([3, 1])}, ShapeError, "strictly increase"),
        ({"time_deviations_s": torch.tensor([1.0, 0])}, InputError, "expected numbers above 0"),
        ({"time_range_s": (1.0, 0.0)}, InputError, "time_range_s: expected first ≤ last"),
        ({"time_range_s": (0.0, math.inf)}, InputError, "time_range_s: expected"),
        ({"gate": 1.0}, ConfigError, r"gate: expected a number in \[0, 1\), got 1.0"),
        ({"gate": math.nan}, ConfigError, "gate: expected"),
        ({"period_s": 0.0}, ConfigError, "period_s: expected a finite number above 0"),
        ({"period_s": math.inf}, ConfigError, "period_s: expected a finite number above 0"),
    ],
)
def test_wrong_parts_are_named(changes: dict, error: type, says: str) -> None:
    with pytest.raises(error, match=says):
        replace(motion([1, 3]), **changes)


def test_waves_of_another_degree_are_named() -> None:
    with pytest.raises(ShapeError, match="expected 16 harmonics like the Gaussians, got 4"):
        motion([0]).state_at(still_gaussians(1, bands=16), 0.0)
