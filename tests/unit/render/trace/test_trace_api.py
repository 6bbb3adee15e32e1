"""What the one function takes, refuses and returns."""

from dataclasses import replace

import pytest
import torch
from oracles_trace import ANSWERS, MOTION, PARAMETERS, answers, bundle, leaves, motion, scene

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.render.trace import support
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings

both = pytest.mark.parametrize(
    "dtype", [torch.float64, torch.float32], ids=["reference", "compiled"]
)


@both
@pytest.mark.parametrize("name", ANSWERS)
def test_only_what_is_asked_for_is_answered(name: str, dtype: torch.dtype) -> None:
    made = trace(scene(dtype=dtype), bundle(dtype=dtype), outputs=[name])
    assert getattr(made, name) is not None
    assert all(getattr(made, other) is None for other in ANSWERS if other != name)
    assert getattr(made, name).shape[0] == 50


@both
@pytest.mark.parametrize("count", [0, 1, 30])
@pytest.mark.parametrize("rays", [0, 1, 30])
def test_nothing_to_see_and_nobody_who_looks(rays: int, count: int, dtype: torch.dtype) -> None:
    background = torch.tensor([0.1, 0.2, 0.3], dtype=dtype, requires_grad=True)
    own, moving = leaves(scene(count, dtype=dtype)), motion(count, dtype=dtype)
    for motion_or_none in (None, moving):
        looking = bundle(rays, dtype=dtype, times=True)
        made = answers(own, looking, motion_or_none, background=background)
        assert made.rgb.shape == (rays, 3)
        assert all(getattr(made, name).shape == (rays,) for name in ANSWERS[1:])
        if count == 0:
            assert torch.equal(made.rgb, background.expand(rays, 3))
            assert not made.alpha.any()
        made.rgb.sum().backward()
        for name in PARAMETERS:
            assert getattr(own, name).grad.shape == getattr(own, name).shape
        own = leaves(own)


@both
def test_rays_that_do_not_exist_see_nothing(dtype: torch.dtype) -> None:
    cloud, rays = scene(dtype=dtype), bundle(dtype=dtype)
    valid = torch.arange(50) % 3 > 0
    spoiled = torch.where(valid[:, None], rays.directions, torch.nan)
    some = Rays(origins=rays.origins, directions=spoiled, valid=valid)
    own = leaves(cloud)
    got, want = answers(own, some, background=(0.1, 0.2, 0.3)), answers(
        cloud, rays.select(valid), background=(0.1, 0.2, 0.3)
    )  # fmt: skip
    for name in ANSWERS:
        seen = getattr(got, name)[valid]
        torch.testing.assert_close(seen, getattr(want, name), rtol=0, atol=2e-6)
        assert not getattr(got, name)[~valid].any()
    got.rgb.sum().backward()
    assert bool(torch.isfinite(own.means.grad).all())


@both
def test_when_no_ray_exists(dtype: torch.dtype) -> None:
    rays = replace(bundle(dtype=dtype), valid=torch.zeros(50, dtype=torch.bool))
    own = leaves(scene(dtype=dtype))
    made = answers(own, rays, background=(1.0, 1.0, 1.0))
    assert not made.rgb.any()
    made.rgb.sum().backward()
    assert not own.means.grad.any()


def test_auto_compiles_for_float32_and_not_for_float64() -> None:
    for dtype, backend in ((torch.float32, "compiled"), (torch.float64, "reference")):
        cloud, rays = scene(dtype=dtype), bundle(dtype=dtype)
        auto = trace(cloud, rays)
        assert torch.equal(auto.rgb, trace(cloud, rays, backend=backend).rgb)
    with pytest.raises(
        ConfigError, match=r"backend 'compiled': expected float32, got torch.float64"
    ):
        trace(scene(), bundle(), backend="compiled")
    with pytest.raises(ConfigError, match="backend: expected one of auto, compiled, reference"):
        trace(scene(), bundle(), backend="raster")


def test_without_numba_the_reference_steps_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(support, "find_spec", lambda name: None)
    cloud, rays = scene(dtype=torch.float32), bundle(dtype=torch.float32)
    assert torch.equal(trace(cloud, rays).rgb, trace(cloud, rays, backend="reference").rgb)
    with pytest.raises(ConfigError, match="expected the package numba, got none"):
        trace(cloud, rays, backend="compiled")


@pytest.mark.usefixtures("as_shipped")
def test_what_does_not_fit_is_refused() -> None:
    cloud, rays = scene(dtype=torch.float32), bundle(dtype=torch.float32)
    with pytest.raises(ShapeError, match="expected one dtype"):
        trace(cloud, bundle())
    with pytest.raises(ShapeError, match="expected as many as Gaussians, 40, got 3"):
        trace(cloud, rays, moving=motion(3, dtype=torch.float32))
    with pytest.raises(InputError, match="expected time_s, because Gaussians move, got None"):
        trace(cloud, rays, moving=motion(40, dtype=torch.float32))
    with pytest.raises(ConfigError, match="outputs: expected"):
        trace(cloud, rays, outputs=("rgb", "normals"))


@both
def test_times_change_nothing_where_nothing_moves(dtype: torch.dtype) -> None:
    cloud = scene(dtype=dtype)
    timed, untimed = bundle(dtype=dtype, times=True), bundle(dtype=dtype)
    assert torch.equal(answers(cloud, timed).rgb, answers(cloud, untimed).rgb)


def test_brute_force_in_little_memory_is_brute_force() -> None:
    cloud, rays = scene(400), bundle(60)
    grads = []
    for memory in (1 << 20, 1 << 30):
        own = leaves(cloud)
        made = trace(own, rays, outputs=ANSWERS, settings=TraceSettings(memory_bytes=memory))
        made.rgb.square().sum().backward()
        grads.append((made.rgb.detach(), made.hits, own.means.grad))
    assert torch.equal(grads[0][0], grads[1][0])
    assert torch.equal(grads[0][1], grads[1][1])
    torch.testing.assert_close(grads[0][2], grads[1][2])


@both
def test_only_gaussians_that_can_shine_take_part_in_gradients(dtype: torch.dtype) -> None:
    moving = motion(dtype=dtype)
    own = leaves(moving)
    made = answers(scene(dtype=dtype), bundle(dtype=dtype, times=True), own)
    made.rgb.sum().backward()
    for name in MOTION:
        grad = getattr(own, name).grad
        assert bool(grad.any())
        assert bool(torch.isfinite(grad).all())
