"""Both back ends next to loops over rays and Gaussians from the formula."""

import pytest
import torch
from oracles_trace import (
    answers,
    assert_as_the_oracle,
    brute_force,
    bundle,
    image,
    motion,
    scene,
)

KINDS = {torch.float64: 1e-12, torch.float32: 1e-5}
both = pytest.mark.parametrize(("dtype", "room"), KINDS.items(), ids=["reference", "compiled"])
SETTINGS = {
    "defaults": {},
    "3dgrt": {"kernel_degree": 4, "min_response": 0.0113, "light_cutoff": 1e-3},
    "toward means": {"color_direction": "mean"},
    "seen from a distance": {"near_distance": 1.5},
    "bright behind": {"background": (0.2, 0.5, 1.0), "alpha_max": 0.5},
    "little light": {"light_cutoff": 0.3},
    "least response": {"min_response": 0.2, "alpha_cutoff": 0.1},
}


@both
@pytest.mark.parametrize("name", SETTINGS)
def test_random_rays(name: str, dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(dtype=torch.float32).to(dtype), bundle(40)
    rays = type(rays)(origins=rays.origins.to(dtype), directions=rays.directions.to(dtype))
    settings = {"near_distance": 0.2} | SETTINGS[name]
    made = answers(cloud, rays, **settings)
    assert_as_the_oracle(made, oracle(cloud, rays, settings), room)


@both
@pytest.mark.parametrize("spread", [0.0, 0.05], ids=["pinhole", "lens"])
def test_an_image(spread: float, dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(seed=2, dtype=dtype), image((9, 11), 8.0, dtype, spread)
    made = answers(cloud, rays, near_distance=0.1)
    assert_as_the_oracle(made, oracle(cloud, rays, {"near_distance": 0.1}), room)


@both
@pytest.mark.parametrize("name", ["defaults", "3dgrt", "toward means"])
@pytest.mark.parametrize("gate", [0.05, 0.0])
def test_gaussians_that_move(gate: float, name: str, dtype: torch.dtype, room: float) -> None:
    cloud, rays, moving = scene(dtype=dtype), bundle(40, dtype=dtype, times=True), None
    moving = motion(dtype=dtype, gate=gate)
    settings = {"near_distance": 0.2} | SETTINGS[name]
    made = answers(cloud, rays, moving, **settings)
    assert_as_the_oracle(made, oracle(cloud, rays, settings, moving), room)


@both
@pytest.mark.parametrize("bands", [1, 4])
def test_harmonics(bands: int, dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(bands=bands, dtype=dtype), bundle(30, dtype=dtype)
    made = answers(cloud, rays)
    assert_as_the_oracle(made, oracle(cloud, rays, {}), room)


@both
def test_weights_and_the_light_left_add_up_to_one(dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(dtype=dtype), bundle(200, dtype=dtype)
    made = answers(cloud, rays, background=(1.0, 1.0, 1.0))
    white = answers(
        type(cloud)(
            means=cloud.means, quats=cloud.quats, scales=cloud.scales, opacities=cloud.opacities,
            sh=torch.full_like(cloud.sh[:, :1], 0.5 / 0.28209479177387814),
        ),
        rays,
        background=(1.0, 1.0, 1.0),
    )  # fmt: skip
    assert bool((made.alpha > 0).any())
    torch.testing.assert_close(white.rgb, torch.ones_like(white.rgb), rtol=0, atol=room)


def oracle(cloud, rays, settings, moving=None):
    from diff4splat.render.trace.settings import TraceSettings

    return brute_force(cloud, rays, TraceSettings(**settings), moving)
