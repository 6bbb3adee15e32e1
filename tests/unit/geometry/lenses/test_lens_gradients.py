"""Gradients of every lens to points, directions and coefficients, and where nothing exists."""

import math
from dataclasses import fields, replace

import pytest
import torch
from lens_cases import NAMES, doubles, lens_case
from torch import Tensor

from diff4splat.geometry.lenses.blender_fisheye import BlenderFisheye
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.geometry.lenses.sensor import sensor_directions, sensor_pixels

BAD = ((math.nan, 0.0, 1.0), (0.0, 0.0, 0.0), (math.inf, 1.0, 1.0))


def tensors(lens: Lens) -> dict[str, Tensor]:
    """The coefficients of a lens by name."""
    values = {f.name: getattr(lens, f.name) for f in fields(lens)}
    return {name: v.clone().requires_grad_() for name, v in values.items() if torch.is_tensor(v)}


def directions_seen(lens: Lens) -> Tensor:
    """Directions with a point, the forward axis first."""
    around = torch.randn(6, 3, dtype=torch.float64) * 0.4 + doubles((0.0, 0.0, 1.0))
    directions = torch.cat([doubles(((0.0, 0.0, 1.0),)), around])
    assert lens.points(directions)[1].all()
    return directions


@pytest.mark.parametrize("name", NAMES)
def test_gradients_of_points(name: str) -> None:
    _, lens = lens_case(name)
    learned = tensors(lens)
    directions = directions_seen(lens).requires_grad_()

    def points(directions: Tensor, *values: Tensor) -> Tensor:
        return replace(lens, **dict(zip(learned, values, strict=True))).points(directions)[0]

    # Powers of up to 20 mm curve too much for the usual step of differences.
    assert torch.autograd.gradcheck(points, (directions, *learned.values()), eps=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_gradients_of_directions(name: str) -> None:
    _, lens = lens_case(name)
    learned = tensors(lens)
    points = lens.points(directions_seen(lens))[0].detach().requires_grad_()

    def directions(points: Tensor, *values: Tensor) -> Tensor:
        return replace(lens, **dict(zip(learned, values, strict=True))).directions(points)[0]

    assert torch.autograd.gradcheck(directions, (points, *learned.values()))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_what_does_not_exist_is_finite_without_gradient(name: str, dtype: torch.dtype) -> None:
    camera, lens = lens_case(name)
    camera, lens = camera.to(dtype), lens.to(dtype)
    learned = tensors(lens)
    lens = replace(lens, **learned)
    camera = replace(camera, center_px=camera.center_px.requires_grad_())
    directions = doubles(BAD).to(dtype).requires_grad_()
    points = doubles(((math.nan, 0.0), (0.0, math.inf), (1e30, -1e30))).to(dtype).requires_grad_()
    pixels, on_sensor = sensor_pixels(camera, lens, directions)
    placed, exists = lens.points(directions)
    seen, visible = lens.directions(points)
    assert not (on_sensor.any() or exists.any() or visible.any())
    assert torch.equal(pixels, camera.center_px.expand(3, 2))
    assert torch.equal(placed, torch.zeros_like(placed))
    assert torch.equal(seen, doubles((0.0, 0.0, 1.0)).to(dtype).expand(3, 3))
    leaves = [directions, points, camera.center_px, *learned.values()]
    total = pixels.sum() + placed.sum() + seen.sum()
    if total.requires_grad:
        gradients = torch.autograd.grad(total, leaves, allow_unused=True)
        assert all(g is None or torch.equal(g, torch.zeros_like(g)) for g in gradients)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_extreme_directions_have_finite_gradients(name: str, dtype: torch.dtype) -> None:
    camera, lens = lens_case(name)
    camera, lens = camera.to(dtype), lens.to(dtype)
    learned = tensors(lens)
    tiny = 1e-20
    directions = doubles(
        ((0, 0, -1), (0, 1, 0), (1, 0, 0), (0, tiny, 1), (0, tiny, -1), (1, 0, tiny), (0, 1, -tiny),
         (0, 1e-7, 1), (1e-7, 0, -1), (1, 1, -1), (1, 0, 1e-6), (tiny, 1, tiny))
    )  # fmt: skip
    directions = directions.to(dtype).requires_grad_()
    lens = replace(lens, **learned)
    points, _ = lens.points(directions)
    back, _ = lens.directions(points)
    leaves = [directions, *learned.values()]
    gradients = torch.autograd.grad(points.sum() + back.sum(), leaves, allow_unused=True)
    assert points.isfinite().all()
    assert back.isfinite().all()
    assert all(g.isfinite().all() for g in gradients if g is not None)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_goes_in_and_nothing_comes_out(name: str) -> None:
    camera, lens = lens_case(name)
    directions, seen = sensor_directions(camera, lens, torch.zeros(0, 4, 2, dtype=torch.float64))
    pixels, exists = sensor_pixels(camera, lens, directions)
    assert directions.shape == (0, 4, 3)
    assert pixels.shape == (0, 4, 2)
    assert seen.shape == exists.shape == (0, 4)


@pytest.mark.parametrize("fold", [OpenCVFisheye, BlenderFisheye])
def test_gradients_stay_finite_at_the_turning_point(fold: type) -> None:
    k = (-0.1, 0.0, 0.0, 0.0) if fold is OpenCVFisheye else (0.0, 1.0, 0.0, -0.1, 0.0)
    coefficients = doubles(k).requires_grad_()
    lens = fold(coefficients=coefficients)
    turn = math.sqrt(1 / 0.3)
    height = turn - 0.1 * turn**3
    offsets = doubles((-1e-3, -1e-8, -1e-14, 0.0, 1e-14, 1e-8, 1e-3))
    at, top = (turn + offsets), (height + offsets)
    angle, radius = (at, top) if fold is OpenCVFisheye else (top, at)
    zero = torch.zeros_like(offsets)
    points, exists = lens.points(torch.stack([angle.sin(), zero, angle.cos()], -1))
    directions, seen = lens.directions(torch.stack([radius, zero], -1))
    (gradient,) = torch.autograd.grad(points.sum() + directions.sum(), coefficients)
    assert gradient.isfinite().all()
    assert bool(exists[0]) and bool(seen[0])
    by_radius = exists if fold is OpenCVFisheye else seen
    assert not by_radius[1:].any()  # too flat for a gradient
    assert not bool(exists[-1]) and not bool(seen[-1])


def test_a_lens_can_be_learned() -> None:
    _, truth = lens_case("fisheye")
    directions = directions_seen(truth)
    wanted = truth.points(directions)[0]
    coefficients = torch.zeros(4, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.LBFGS([coefficients], max_iter=60, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        optimizer.zero_grad()
        points = replace(truth, coefficients=coefficients).points(directions)[0]
        error = (points - wanted).square().sum()
        error.backward()
        return error

    optimizer.step(loss)
    learned = replace(truth, coefficients=coefficients).points(directions)[0]
    torch.testing.assert_close(learned, wanted, atol=1e-4, rtol=0)
