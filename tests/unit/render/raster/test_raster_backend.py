"""How the CPU renderer behaves as a part of a program: refusals, threads, forks, autograd."""

import gc
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from oracles_raster import LENS, PARAMETERS, cloud, leaves, lens_leaves, wide_camera

from diff4splat.errors import ConfigError
from diff4splat.render.api import render
from diff4splat.render.raster import backend, function
from diff4splat.render.raster.backward import Drawn
from diff4splat.render.raster.jit import GROUP
from diff4splat.render.settings import RenderJob, RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = wide_camera((40, 50))
SUPPORT = Path(__file__).parents[3] / "support"


def rgb(gaussians: Gaussians, **settings: object) -> torch.Tensor:
    return render(gaussians, CAMERA, settings=RenderSettings(**settings), backend="raster").rgb


def assert_refused(gaussians: Gaussians, reason: str, **settings: object) -> None:
    """Asked for by name it says why; asked for any back end, another one answers."""
    with pytest.raises(ConfigError, match=rf"backend 'raster': {reason}.*; use backend='auto'"):
        rgb(gaussians, **settings)
    assert render(gaussians, CAMERA, settings=RenderSettings(**settings)).rgb is not None


def test_double_precision_is_refused() -> None:
    assert_refused(cloud(5).to(torch.float64), r"expected float32, got torch\.float64")


def test_other_tiles_are_refused() -> None:
    assert_refused(cloud(5), r"expected tile_px among \(8, 16, 32, 64\), got 5", tile_px=5)


def test_too_many_gaussians_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_MOST_GAUSSIANS", 6)
    assert rgb(cloud(5)).any()
    assert_refused(cloud(6), "expected fewer than 6 Gaussians, got 6")


def test_without_numba_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "find_spec", lambda name: None)
    assert_refused(cloud(5), "expected the package numba, got none; install it")


def test_other_devices_are_refused() -> None:
    job = RenderJob(
        gaussians=cloud(5).to(torch.device("meta")),
        camera=CAMERA,
        outputs=frozenset({"rgb"}),
        settings=RenderSettings(),
        flow_gaussians=cloud(5),
        flow_camera=CAMERA,
    )
    assert backend.unsupported_reason(job) == "expected CPU tensors, got meta"


def test_what_it_can_do_is_not_refused() -> None:
    assert torch.equal(render(cloud(50), CAMERA).rgb, rgb(cloud(50)))


def run(code: str, timeout_s: float = 600) -> str:
    """What a fresh interpreter prints."""
    header = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    done = subprocess.run(
        [sys.executable, "-c", header + code],
        capture_output=True, text=True, timeout=timeout_s, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_numba_is_loaded_with_the_first_image_and_not_before() -> None:
    code = """
import diff4splat.render.api
from oracles_render import random_gaussians, small_camera
print("numba" in sys.modules)
diff4splat.render.api.render(random_gaussians(3), small_camera())
print("numba" in sys.modules)
import torch
small = random_gaussians(3, dtype=torch.float32)
diff4splat.render.api.render(small, small_camera(dtype=torch.float32))
print("numba" in sys.modules)
"""
    assert run(code).split() == ["False", "False", "True"]


def test_a_fork_renders_the_same() -> None:
    code = """
import os, threading, torch
from oracles_raster import cloud, leaves, render_raster, wide_camera
torch.set_num_threads(3)
def both():
    own = leaves(cloud(500))
    rgb = render_raster(own, wide_camera((40, 50)), "rgb", tile_px=8).rgb
    rgb.sum().backward()
    return rgb.detach(), own.means.grad
before = both()
child = os.fork()
if child == 0:
    after = both()
    own_threads = threading.active_count() > 1
    os._exit(0 if own_threads and all(map(torch.equal, before, after)) else 3)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert run(code).split() == ["0"]


def test_four_callers_at_once() -> None:
    scenes = [cloud(300 + 50 * seed, seed, bands=4) for seed in range(4)]
    made = [[] for _ in scenes]

    def both(gaussians: Gaussians) -> tuple[torch.Tensor, torch.Tensor]:
        own = leaves(gaussians)
        image = rgb(own, tile_px=8)
        image.square().sum().backward()
        return image.detach(), own.scales.grad

    def call(index: int) -> None:
        for _ in range(5):
            made[index].append(both(scenes[index]))

    callers = [threading.Thread(target=call, args=(index,)) for index in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(timeout=300)
        assert not caller.is_alive()
    for gaussians, runs in zip(scenes, made, strict=True):
        want = both(gaussians)
        assert len(runs) == 5
        assert all(torch.equal(*pair) for one in runs for pair in zip(one, want, strict=True))


class Watched(Drawn):
    """Buffers that can be referred to weakly."""


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """How many sets of buffers are still alive."""
    GROUP.ensure_compiled()
    references = []

    def make(**parts: object) -> Watched:
        made = Watched(**parts)
        references.append(weakref.ref(made))
        return made

    monkeypatch.setattr(function, "Drawn", make)

    def count() -> int:
        gc.collect()
        return sum(reference() is not None for reference in references)

    return count


def test_buffers_are_kept_for_the_way_back_only(kept: Callable[[], int]) -> None:
    with torch.no_grad():
        made = rgb(leaves(cloud(20)))
    plain = rgb(cloud(20))
    assert kept() == 0
    assert not made.requires_grad and not plain.requires_grad
    wanted = rgb(leaves(cloud(20)))
    assert kept() == 1
    del wanted
    assert kept() == 0


@pytest.mark.parametrize("curved", [False, True])
def test_a_gradient_of_a_gradient_is_refused(curved: bool) -> None:
    own = leaves(cloud(20))
    image = rgb(own)
    loss = image.square().sum() if curved else image.sum()
    # Silence would be a gradient that lacks a term.
    with pytest.raises(RuntimeError, match=r"create_graph|differentiate twice"):
        (grad,) = torch.autograd.grad(loss, own.means, create_graph=True)
        (loss + grad.square().sum()).backward()


def test_inference_mode() -> None:
    with torch.inference_mode():
        inside = rgb(cloud(50))
    assert torch.equal(inside, rgb(cloud(50)))


def test_any_layout_of_the_inputs() -> None:
    gaussians = cloud(60, bands=4)
    odd = {name: torch.stack([getattr(gaussians, name)] * 2, -1)[..., 1] for name in PARAMETERS[:4]}
    odd["sh"] = gaussians.sh.transpose(0, 2).contiguous().transpose(0, 2)
    scattered, packed = replace(gaussians, **odd), leaves(gaussians)
    assert not any(getattr(scattered, name).is_contiguous() for name in PARAMETERS)
    sources = {name: getattr(scattered, name).requires_grad_() for name in PARAMETERS}
    made, want = rgb(scattered), rgb(packed)
    assert torch.equal(made, want)
    made.square().sum().backward()
    want.square().sum().backward()
    for name, source in sources.items():
        assert torch.equal(source.grad, getattr(packed, name).grad), name


def test_expanded_inputs_collect_the_sum_of_their_gradients() -> None:
    gaussians = cloud(60)
    shared = torch.tensor([0.06, 0.05, 0.04], requires_grad=True)
    copied = shared.detach().expand(60, 3).contiguous().requires_grad_()
    for scales in (shared.expand(60, 3), copied):
        rgb(replace(gaussians, scales=scales)).sum().backward()
    torch.testing.assert_close(shared.grad, copied.grad.sum(0))


def test_inputs_are_left_as_they_were() -> None:
    own, lens = leaves(cloud(60, bands=4)), lens_leaves(CAMERA, torch.float32)
    before = {name: getattr(own, name).detach().clone() for name in PARAMETERS}
    render(own, lens, outputs=("rgb", "depth"), backend="raster").rgb.sum().backward()
    assert all(torch.equal(getattr(own, name), value) for name, value in before.items())
    assert all(torch.equal(getattr(lens, name), getattr(CAMERA, name)) for name in LENS)


def test_inputs_changed_before_the_way_back_are_noticed() -> None:
    own = cloud(20)
    scales = own.scales.clone().requires_grad_() * 1.0
    image = rgb(replace(own, scales=scales))
    scales.add_(1.0)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        image.sum().backward()


@pytest.mark.parametrize("name", ["rgb", "alpha", "depth", "features"])
def test_images_may_be_changed_in_place(name: str) -> None:
    grads = []
    for in_place in (False, True):
        own = leaves(cloud(60))
        settings = RenderSettings(features=own.means * 1.0)
        made = render(own, CAMERA, outputs=(name,), settings=settings, backend="raster")
        image = getattr(made, name)
        image = image.clamp_(0.1, 0.4) if in_place else image.clamp(0.1, 0.4)
        image.sum().backward()
        grads.append(own.means.grad)
    assert torch.equal(grads[0], grads[1])


def test_a_batch_of_cameras() -> None:
    gaussians = cloud(60)
    poses = CAMERA.world_from_camera.repeat(3, 1, 1)
    poses[:, 0, 3] = torch.tensor([0.0, 0.2, -0.3])
    made = render(gaussians, CAMERA.with_pose(poses), backend="raster").rgb
    assert made.shape == (3, 40, 50, 3)
    for pose, image in zip(poses, made, strict=True):
        one = render(gaussians, CAMERA.with_pose(pose), backend="raster").rgb
        assert torch.equal(image, one)


@pytest.mark.usefixtures("as_shipped")
def test_whole_numbers_in_the_settings_compile_nothing() -> None:
    rgb(cloud(5))
    compiled = [len(kernel.signatures) for kernel in GROUP.kernels]
    whole = rgb(cloud(5), dilation_px2=1, near_depth=1)
    assert [len(kernel.signatures) for kernel in GROUP.kernels] == compiled
    assert torch.equal(whole, rgb(cloud(5), dilation_px2=1.0, near_depth=1.0))
