"""Gradients: brute force by finite differences, compiled next to brute force in float64."""

from dataclasses import replace

import pytest
import torch
from oracles_raster import assert_gradients_agree
from oracles_trace import MOTION, PARAMETERS, answers, bundle, image, leaves, motion, scene
from torch import Tensor

from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians

TOLERANCE = 2e-5
DIFFERENTIABLE = ("rgb", "distance", "median_distance", "alpha")
SETTINGS = {
    "defaults": {},
    "3dgrt": {"kernel_degree": 4, "min_response": 0.0113, "light_cutoff": 1e-3},
    "toward means": {"color_direction": "mean"},
    "half opaque": {"alpha_max": 0.5, "light_cutoff": 0.05},
}


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize(
    "moves",
    [pytest.param(False, id="still", marks=pytest.mark.slow), pytest.param(True, id="moving")],
)
def test_of_brute_force_are_those_of_finite_differences(moves: bool, name: str) -> None:
    cloud = scene(4, seed=3)
    ahead = torch.tensor([0.0, 0.0, 3.0], dtype=torch.float64)
    cloud = replace(cloud, means=0.15 * cloud.means + ahead, opacities=0.2 + 0.7 * cloud.opacities)
    rays = Rays(
        origins=0.1 * cloud.quats[:3, :3],
        directions=cloud.means[:3],
        time_s=torch.tensor([0.1, 0.5, 0.9], dtype=torch.float64),
    )
    moving = None
    if moves:
        moving = motion(4)
        moving = replace(moving, velocities=0.2 * moving.velocities)
    leaf = inputs(cloud, rays, moving, torch.float64)
    settings = {"near_distance": 0.1, "alpha_cutoff": 1e-4} | SETTINGS[name]

    def see(*values: Tensor) -> tuple[Tensor, ...]:
        made = look(dict(zip(leaf, values, strict=True)), moving, settings)
        return tuple(getattr(made, answer) for answer in DIFFERENTIABLE)

    assert float(see(*leaf.values())[3].detach().sum()) > 0.5
    assert torch.autograd.gradcheck(see, tuple(leaf.values()), atol=1e-6)


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
@pytest.mark.parametrize("bands", [1, 9])
def test_compiled_are_those_of_brute_force(bands: int, moves: bool, name: str) -> None:
    cloud, rays = scene(60, bands=bands, dtype=torch.float32), bundle(150, dtype=torch.float32)
    rays = replace(rays, time_s=torch.linspace(0, 1, 150))
    moving = motion(60, dtype=torch.float32) if moves else None
    settings = {"near_distance": 0.2} | SETTINGS[name]
    compare(cloud, rays, moving, settings)


@pytest.mark.parametrize("spread", [0.0, 0.02], ids=["pinhole", "lens"])
def test_of_an_image(spread: float) -> None:
    # Many small Gaussians, of which each packet of rays meets some.
    cloud = scene(400, seed=8, bands=4, dtype=torch.float32)
    cloud = replace(cloud, scales=0.3 * cloud.scales)
    compare(cloud, image((24, 28), 20.0, torch.float32, spread), None, {"near_distance": 0.2})


@pytest.mark.parametrize("name", [*PARAMETERS, "origins", "directions", "time_s", *MOTION])
def test_of_one_input_alone(name: str) -> None:
    cloud, rays = scene(20, dtype=torch.float32), bundle(30, dtype=torch.float32, times=True)
    moving, grads = motion(20, dtype=torch.float32), []
    for alone in (False, True):
        leaf = inputs(cloud, rays, moving, torch.float32)
        for other, value in leaf.items():
            value.requires_grad_(not alone or other == name)
        look(leaf, moving, {}).rgb.square().sum().backward()
        grads.append(leaf[name].grad)
        assert all(v.grad is None for other, v in leaf.items() if alone and other != name)
    assert bool(grads[0].any())
    assert torch.equal(*grads)


def test_of_the_background() -> None:
    background = torch.tensor([0.1, 0.2, 0.3], requires_grad=True)
    made = answers(
        scene(dtype=torch.float32), bundle(20, dtype=torch.float32), background=background
    )
    made.rgb.sum().backward()
    light = (1 - made.alpha).sum()
    torch.testing.assert_close(background.grad, light.expand(3))


def test_what_no_ray_meets_has_none() -> None:
    cloud = scene(40, dtype=torch.float32)
    means = cloud.means.clone()
    means[::2] = torch.tensor([0.0, 0.0, -50.0])
    own = leaves(replace(cloud, means=means))
    answers(own, image((8, 8), 8.0, torch.float32)).rgb.sum().backward()
    for name in PARAMETERS:
        grad = getattr(own, name).grad
        assert not grad[::2].any()
        assert bool(grad[1::2].any())


def test_what_is_held_to_the_largest_alpha_still_has_a_colour() -> None:
    cloud = scene(1, dtype=torch.float32)
    cloud = replace(cloud, opacities=torch.ones(1), means=torch.tensor([[0.0, 0.0, 3.0]]))
    own, ahead = leaves(cloud), image((1, 1), 1.0, torch.float32)
    answers(own, ahead).rgb.sum().backward()
    assert float(own.opacities.grad) == 0.0
    assert not own.means.grad.any()
    assert bool(own.sh.grad.any())


def test_the_way_back_can_be_taken_twice_but_not_differentiated() -> None:
    own, rays = leaves(scene(dtype=torch.float32)), bundle(20, dtype=torch.float32)
    total = answers(own, rays).rgb.square().sum()
    total.backward(retain_graph=True)
    first = own.means.grad.clone()
    own.means.grad = None
    total.backward(retain_graph=True)
    assert torch.equal(own.means.grad, first)
    with pytest.raises(RuntimeError, match="use backend='reference' to differentiate twice"):
        torch.autograd.grad(total, own.means, create_graph=True)


def inputs(
    cloud: Gaussians, rays: Rays, moving: MovingCloud | None, dtype: torch.dtype
) -> dict[str, Tensor]:
    """Everything that has a gradient, by name."""
    parts = [getattr(cloud, name) for name in PARAMETERS]
    parts += [rays.origins, rays.directions]
    names = [*PARAMETERS, "origins", "directions"]
    if moving is not None:
        parts += [rays.time_s, *(getattr(moving, name) for name in MOTION)]
        names += ["time_s", *MOTION]
    copies = [part.detach().to(dtype).clone().requires_grad_() for part in parts]
    return dict(zip(names, copies, strict=True))


def look(leaf: dict[str, Tensor], moving: MovingCloud | None, settings: dict):
    """All answers from the leaves."""
    cloud = Gaussians(**{name: leaf[name] for name in PARAMETERS})
    rays = Rays(origins=leaf["origins"], directions=leaf["directions"], time_s=leaf.get("time_s"))
    if moving is not None:
        moving = replace(moving, **{name: leaf[name] for name in MOTION})
    return answers(cloud, rays, moving, **settings)


def compare(cloud: Gaussians, rays: Rays, moving: MovingCloud | None, settings: dict) -> None:
    """Float32 compiled next to float64 brute force, over the rays that hit as many."""
    generator = torch.Generator().manual_seed(9)
    weights = torch.randn(len(rays), 6, generator=generator, dtype=torch.float64)
    made, leaf = {}, {}
    for dtype in (torch.float64, torch.float32):
        leaf[dtype] = inputs(cloud, rays, moving, dtype)
        made[dtype] = look(leaf[dtype], moving, settings)
    alike = made[torch.float64].hits == made[torch.float32].hits
    assert alike.double().mean() > 0.95
    assert float(made[torch.float32].alpha.detach().mean()) > 0.1
    for dtype, answer in made.items():
        own = (weights * alike[:, None]).to(dtype)
        total = (answer.rgb * own[:, :3]).sum() + (answer.alpha * own[:, 3]).sum()
        total = total + 0.3 * (answer.distance * own[:, 4]).sum()
        (total + 0.1 * (answer.median_distance * own[:, 5]).sum()).backward()
    for name, want in leaf[torch.float64].items():
        assert_gradients_agree(leaf[torch.float32][name].grad, want.grad, name, TOLERANCE)
