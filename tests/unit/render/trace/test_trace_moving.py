"""Gaussians that move: the 4D formula without slicing, closed forms, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_trace import (
    MOTION,
    answers,
    as_array,
    bundle,
    covariance,
    motion,
    ray,
    scene,
    sphere,
)

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays

KINDS = {torch.float64: 1e-12, torch.float32: 5e-6}
both = pytest.mark.parametrize(("dtype", "room"), KINDS.items(), ids=["reference", "compiled"])


def single(velocity: float = 1.0, center: float = 0.0, deviation: float = 1.0, **others: object):
    """One motion along x."""

    def tensor(values: list) -> torch.Tensor:
        return torch.tensor(values, dtype=others.get("dtype", torch.float64))

    return MovingCloud(
        velocities=tensor([[velocity, 0.0, 0.0]]),
        time_centers_s=tensor([center]),
        time_deviations_s=tensor([deviation]),
        gate=others.get("gate", 0.05),
    )


def at(time_s: float, dtype: torch.dtype, x: float = 0.0) -> Rays:
    return ray((x, 0.0, 0.0), dtype=dtype, time_s=torch.tensor([time_s], dtype=dtype))


def four_dimensional_peak(mean, sigma, pulse, origin, direction, time_s):
    """max over τ of p(t) p(x(τ) | t), by the 4D covariance and without slicing it."""
    velocity, center, deviation = pulse
    space_time = np.empty((4, 4))
    space_time[:3, :3] = sigma + deviation**2 * np.outer(velocity, velocity)
    space_time[:3, 3] = space_time[3, :3] = deviation**2 * velocity
    space_time[3, 3] = deviation**2
    precision = np.linalg.inv(space_time)
    start = np.append(origin - mean, time_s - center)
    along = np.append(direction, 0.0)
    tau = -(along @ precision @ start) / (along @ precision @ along)
    point = start + tau * along
    return math.exp(-0.5 * point @ precision @ point), tau


@both
def test_the_slice_is_the_four_dimensional_gaussian(dtype: torch.dtype, room: float) -> None:
    cloud, moving = scene(30, seed=7, dtype=dtype), motion(30, dtype=dtype, gate=0.0)
    rays, seen = bundle(30, dtype=dtype, times=True), 0
    for i in range(30):
        one = cloud.select(slice(i, i + 1))
        only = moving.select(torch.tensor([i]))
        line = rays.select(slice(i, i + 1))
        response, tau = four_dimensional_peak(
            as_array(one.means)[0],
            covariance(as_array(one.quats)[0], as_array(one.scales)[0]),
            [as_array(getattr(only, name))[0] for name in MOTION],
            as_array(line.origins)[0],
            as_array(line.directions)[0],
            float(line.time_s),
        )
        made = answers(one, line, only, alpha_cutoff=1e-9, alpha_max=1 - 1e-7, near_distance=0.0)
        if tau > 0.01 and float(one.opacities) * response > 1e-8:
            seen += 1
            assert made.alpha.item() == pytest.approx(float(one.opacities) * response, abs=room)
            assert made.distance.item() == pytest.approx(tau, rel=max(room, 1e-10))
    assert seen >= 5


@both
def test_the_mean_moves_and_the_pulse_dims(dtype: torch.dtype, room: float) -> None:
    cloud, moving = sphere(dtype=dtype), single(0.5, 0.2, 0.4, dtype=dtype)
    for time_s in (-0.3, 0.2, 0.6):
        pulse = math.exp(-0.5 * ((time_s - 0.2) / 0.4) ** 2)
        centred = answers(cloud, at(time_s, dtype, 0.5 * (time_s - 0.2)), moving)
        assert centred.alpha.item() == pytest.approx(0.8 * pulse, abs=room)
        assert centred.distance.item() == pytest.approx(2.0, abs=room)


@both
def test_a_pulse_at_or_below_the_gate_is_dark(dtype: torch.dtype, room: float) -> None:
    cloud, reach = sphere(opacity=1.0, dtype=dtype), math.sqrt(-2 * math.log(0.05))
    assert reach == pytest.approx(2.448, abs=1e-3)
    for part, hits in ((0.999, 1), (1.001, 0), (-0.999, 1), (-1.001, 0)):
        moving = single(0.0, dtype=dtype)
        assert answers(cloud, at(part * reach, dtype), moving).hits.item() == hits
    assert answers(cloud, at(3.0, dtype), single(0.0, dtype=dtype, gate=0.0)).hits.item() == 1


@both
def test_what_shines_for_ever_and_stands_still_is_a_still_scene(
    dtype: torch.dtype, room: float
) -> None:
    cloud, rays = scene(dtype=dtype), bundle(50, dtype=dtype, times=True)
    still = MovingCloud(
        velocities=torch.zeros_like(cloud.means),
        time_centers_s=torch.zeros_like(cloud.opacities),
        time_deviations_s=torch.full_like(cloud.opacities, math.inf),
    )
    got, want = answers(cloud, rays, still), answers(cloud, rays)
    torch.testing.assert_close(got.rgb, want.rgb, rtol=0, atol=room)
    assert torch.equal(got.hits, want.hits)


@both
def test_every_ray_sees_its_own_time(dtype: torch.dtype, room: float) -> None:
    # A sphere crosses the view; rays side by side look later and later, as behind a shutter.
    times = torch.linspace(-1.0, 1.0, 50, dtype=dtype)
    x = 0.3 * times
    rays = Rays(
        origins=torch.stack([x, torch.zeros_like(x), torch.zeros_like(x)], 1),
        directions=torch.tensor([[0.0, 0.0, 1.0]], dtype=dtype).repeat(50, 1),
        time_s=times,
    )
    moving = single(0.3, 0.0, math.inf, dtype=dtype)
    made = answers(sphere(scale=0.05, dtype=dtype), rays, moving)
    torch.testing.assert_close(made.alpha, torch.full_like(times, 0.8), rtol=0, atol=room)
    frozen = answers(
        sphere(scale=0.05, dtype=dtype), replace(rays, time_s=torch.zeros_like(times)), moving
    )
    assert int((frozen.hits > 0).sum()) < 50


@pytest.mark.usefixtures("as_shipped")
def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(
        ShapeError, match=r"MovingCloud.velocities: expected \(1, 3\), got \(2, 3\)"
    ):
        replace(single(), velocities=torch.zeros(2, 3))
    for gate in (-0.1, 1.0, math.nan):
        with pytest.raises(ConfigError, match=r"MovingCloud.gate: expected at least 0"):
            replace(single(), gate=gate)
