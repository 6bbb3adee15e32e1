"""v-prediction on our straight path: the oracle is CogVideoX's own schedule in float64."""

import cogvideox_folder
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.models.cogvideox.noise_schedule import (
    STEPS,
    path_norm,
    step_of_level,
    trained_levels,
    v_from_velocity,
    velocity_from_v,
)
from diff4splat.models.config.joint import JointConfig

SCHEDULES = [
    JointConfig(level_width=8, betas=betas, snr_shift=shift, zero_terminal_snr=zero)
    for betas in ("scaled_linear", "linear", "cosine")
    for shift in (1.0, 3.0)
    for zero in (True, False)
]


@pytest.mark.parametrize(
    "config", SCHEDULES, ids=lambda c: f"{c.betas}-{c.snr_shift:g}-{c.zero_terminal_snr}"
)
def test_levels_are_those_of_diffusers(config: JointConfig) -> None:
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    names = {"cosine": "squaredcos_cap_v2"}
    scheduler = diffusers.CogVideoXDDIMScheduler(
        beta_schedule=names.get(config.betas, config.betas),
        snr_shift_scale=config.snr_shift,
        rescale_betas_zero_snr=config.zero_terminal_snr,
    )
    share = scheduler.alphas_cumprod.double().numpy()
    want = np.sqrt(1 - share) / (np.sqrt(share) + np.sqrt(1 - share))
    # Only this one is in float64 there.
    tolerance = 1e-12 if config.betas == "scaled_linear" else 5e-5
    np.testing.assert_allclose(trained_levels(config), want, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    "config", SCHEDULES, ids=lambda c: f"{c.betas}-{c.snr_shift:g}-{c.zero_terminal_snr}"
)
def test_steps_go_to_their_levels_and_back(config: JointConfig) -> None:
    levels = torch.from_numpy(trained_levels(config))
    assert bool((levels.diff() > 0).all())
    torch.testing.assert_close(step_of_level(levels, config), torch.arange(STEPS).double())
    between = step_of_level(torch.linspace(0, 1, 5001), config)
    assert bool((between.diff() >= 0).all())
    assert between[0] == 0
    assert between[-1] == STEPS - 1


def test_single_precision_levels_find_their_steps() -> None:
    config = SCHEDULES[0]
    levels = torch.from_numpy(trained_levels(config))
    off = step_of_level(levels.float(), config) - torch.arange(STEPS)
    assert float(off.abs().max()) < 1e-3


UNIT = st.floats(0, 1)
NUMBER = st.floats(-1e3, 1e3)


@given(UNIT, NUMBER, NUMBER)
def test_velocity_follows_from_v_and_back(level: float, clean: float, noise: float) -> None:
    level, clean, noise = (torch.tensor(each).double() for each in (level, clean, noise))
    alpha, sigma = (1 - level) / path_norm(level), level / path_norm(level)
    noisy, v = (1 - level) * clean + level * noise, alpha * noise - sigma * clean
    velocity = velocity_from_v(noisy, v, level)
    torch.testing.assert_close(velocity, noise - clean, rtol=1e-12, atol=1e-11)
    torch.testing.assert_close(v_from_velocity(noisy, velocity, level), v, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_both_ends_are_finite_with_their_gradients(level: float) -> None:
    noisy, v = (torch.randn(3, dtype=torch.float32, requires_grad=True) for _ in range(2))
    velocity = velocity_from_v(noisy, v, torch.tensor(level))
    velocity.sum().backward()
    for value in (velocity, noisy.grad, v.grad):
        assert bool(torch.isfinite(value).all())
    want = v - noisy if level == 0 else noisy + v
    torch.testing.assert_close(velocity, want)


def test_gradients_are_right() -> None:
    level = torch.tensor([0.0, 0.3, 1.0], dtype=torch.float64)
    noisy, v = (torch.randn(2, 3, dtype=torch.float64, requires_grad=True) for _ in range(2))
    assert torch.autograd.gradcheck(lambda a, b: velocity_from_v(a, b, level), (noisy, v))


@torch.no_grad()
@pytest.mark.parametrize("kind", ["2b"], indirect=True)
@pytest.mark.parametrize("steps", [4, 10])
def test_euler_steps_are_those_of_ddim(kind: str, steps: int) -> None:
    from diff4splat.flow.samplers import SAMPLERS, integrate

    scheduler = cogvideox_folder.scheduler(kind)
    scheduler.set_timesteps(steps)
    table = trained_levels(JointConfig(level_width=8, snr_shift=3.0))
    noise = torch.randn(1, 2, 3, 2, 2, dtype=torch.float64)

    def network(x: torch.Tensor, step: float) -> torch.Tensor:
        return torch.sin(x + step / 300)

    state = noise
    for step in scheduler.timesteps:
        state = scheduler.step(network(state, float(step)), int(step), state).prev_sample
    levels = [*(float(table[int(step)]) for step in scheduler.timesteps), 0.0]
    config = JointConfig(level_width=8, snr_shift=3.0)

    def velocity(noisy: torch.Tensor, level: float) -> torch.Tensor:
        at = torch.tensor(level, dtype=torch.float64)
        v = network(noisy / path_norm(at), float(step_of_level(at, config)))
        return velocity_from_v(noisy, v, at)

    got = integrate(SAMPLERS["euler"], velocity, noise, levels)
    torch.testing.assert_close(got, state, rtol=1e-7, atol=1e-7)
