"""Compiled features against the PyTorch ones: equal to rounding, whatever the sizes."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import torch
from oracles_hexplane import BOX, random_planes, random_points, with_levels
from torch import Tensor

from diff4splat.scene.motion.hexplane import sampling
from diff4splat.scene.motion.hexplane.planes import HexPlanes, HexPlaneSize

F32 = torch.float32
SIZES = {
    "usual": (HexPlaneSize(space=(8, 7, 6), time=5), 3000, (1.1, 2.6)),
    "one level": (HexPlaneSize(space=(3, 2, 9), time=2, multipliers=(1,)), 50, (2.0,)),
    "wide": (HexPlaneSize(space=(4, 4, 4), time=9, channels=48, multipliers=(1, 2, 3)), 40, (3.0,)),
    "one node": (HexPlaneSize(space=(1, 1, 1), time=1), 10, (1.0, 2.0, 3.0)),
    "no points": (HexPlaneSize(space=(2, 3, 4), time=5), 0, (1.5,)),
    "no times": (HexPlaneSize(space=(2, 3, 4), time=5), 4, ()),
}


def made_by(which: str, planes: HexPlanes, points: Tensor, times: tuple) -> list[Tensor]:
    """Features and all gradients."""
    tables = [
        table.detach().requires_grad_()
        for level in planes.levels
        for table in sampling.at_times(level, [(t - 1) / 2 for t in times])
    ]
    unit = ((points - BOX[0]) / (BOX[1] - BOX[0])).requires_grad_()
    if which == "compiled":
        from diff4splat.scene.motion.hexplane.compiled_features import features

        out = features(unit, tables)
    else:
        out = sampling.plain_features(unit, tables)
    seed = torch.randn(out.shape, generator=torch.Generator().manual_seed(5))
    return [out.detach(), *torch.autograd.grad(out, [unit, *tables], seed)]


@contextmanager
def threads(count: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("name", SIZES)
def test_values_and_gradients_are_those_of_pytorch(name: str) -> None:
    size, count, times = SIZES[name]
    planes, points = random_planes(size, F32), random_points(count, F32)
    got, want = (made_by(which, planes, points, times) for which in ("compiled", "plain"))
    for ours, theirs in zip(got, want, strict=True):
        scale = float(theirs.abs().max()) if theirs.numel() else 1.0
        torch.testing.assert_close(ours, theirs, rtol=0, atol=2e-6 * max(scale, 1e-6))


def test_any_number_of_threads_gives_the_same_bits() -> None:
    size = HexPlaneSize(space=(8, 8, 8), time=5, channels=32, multipliers=(1, 2, 4))
    planes, points = random_planes(size, F32), random_points(5000, F32)
    made = []
    for count in (1, 2, 5):
        with threads(count):
            made.append(made_by("compiled", planes, points, (1.2, 2.2)))
    for other in made[1:]:
        assert all(torch.equal(a, b) for a, b in zip(made[0], other, strict=True))


def test_points_on_nodes_and_borders_have_the_same_slopes() -> None:
    planes = random_planes(HexPlaneSize(space=(3, 3, 3), time=3), F32)
    steps = torch.tensor([-0.5, 0.0, 0.25, 0.5, 1.0, 1.5])
    points = BOX[0] + torch.cartesian_prod(steps, steps, steps) * (BOX[1] - BOX[0])
    got, want = (made_by(which, planes, points, (2.0,)) for which in ("compiled", "plain"))
    for ours, theirs in zip(got, want, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-5)


def test_what_is_no_number_is_the_same_too() -> None:
    planes = random_planes(HexPlaneSize(space=(3, 4, 5), time=3), F32)
    points = random_points(6, F32)
    points[1, 0], points[2, 1], points[3, 2] = torch.nan, torch.inf, -torch.inf
    got, want = (made_by(which, planes, points, (2.0,)) for which in ("compiled", "plain"))
    for ours, theirs in zip(got, want, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-5, equal_nan=True)


def test_strided_planes_are_read_as_they_are() -> None:
    planes = random_planes(HexPlaneSize(space=(3, 4, 5), time=3), F32)
    strided = [[p.permute(2, 0, 1).contiguous().permute(1, 2, 0) for p in planes.levels[0]]]
    points = random_points(6, F32)
    alone = with_levels(planes, planes.levels[:1])
    got = with_levels(planes, strided).features(points, 1.4)
    assert torch.equal(got, alone.features(points, 1.4))


def test_other_precisions_and_channels_take_the_pytorch_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taken = []
    genuine = sampling.plain_features
    monkeypatch.setattr(sampling, "plain_features", lambda *a: taken.append(1) or genuine(*a))
    random_planes().features(random_points(3), 2.0)
    narrow = HexPlaneSize(space=(2, 2, 2), time=2, channels=8)
    random_planes(narrow, F32).features(random_points(3, F32), 2.0)
    assert len(taken) == 2
    random_planes(dtype=F32).features(random_points(3, F32), 2.0)
    assert len(taken) == 2


def test_differentiating_twice_is_refused() -> None:
    planes, points = random_planes(dtype=F32), random_points(3, F32).requires_grad_()
    made = planes.features(points, 2.0).square().sum()
    (slope,) = torch.autograd.grad(made, points, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        slope.sum().backward()


@pytest.mark.slow
def test_numba_is_loaded_by_the_first_compiled_features_and_not_before() -> None:
    code = (
        "import sys, torch\n"
        "from diff4splat.scene.motion.hexplane import motion, planes, regularisers\n"
        "from diff4splat.scene.motion import bake\n"
        "made = planes.make_planes(planes.HexPlaneSize(), torch.eye(3)[:2], (0.0, 1.0))\n"
        "made.to(torch.float64).features(torch.zeros(1, 3, dtype=torch.float64), 0.5)\n"
        "assert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))


def test_precompilation_reaches_both_kernels() -> None:
    from diff4splat.scene.motion.hexplane.jit import GROUP

    assert GROUP.precompile() >= 0
    assert GROUP.is_ready()
    assert GROUP.kernel_count() == 2
    assert all(kernel.signatures for kernel in GROUP.kernels)
