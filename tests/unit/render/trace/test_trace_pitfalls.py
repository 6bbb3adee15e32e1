"""Where other renderers of Gaussians went wrong along rays, one test each.

Colours seen along the ray or toward the mean, quaternions of zero and what expected and median
distance are have their tests in ``test_trace_closed_forms.py``, directions of any length also in
``test_trace_rays.py``.
"""

import math
from dataclasses import replace

import pytest
import torch
from oracles_trace import PARAMETERS, answers, bundle, leaves, motion, ray, scene, sphere

from diff4splat.errors import ShapeError
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians, concatenate

KINDS = {torch.float64: 1e-12, torch.float32: 5e-6}
both = pytest.mark.parametrize(("dtype", "room"), KINDS.items(), ids=["reference", "compiled"])
CUTOFF = TraceSettings().alpha_cutoff


@both
def test_gaussians_behind_the_origin_are_no_mirror_images_and_have_no_gradients(
    dtype: torch.dtype, room: float
) -> None:
    ahead, behind = sphere(dtype=dtype), sphere((0.0, 0.0, -2.0), dtype=dtype)
    own = leaves(concatenate([ahead, behind]))
    made = answers(own, ray((0.02, 0.0, 0.0), dtype=dtype))
    alone = answers(ahead, ray((0.02, 0.0, 0.0), dtype=dtype))
    assert torch.equal(made.rgb, alone.rgb)
    (made.rgb.sum() + made.distance.sum() + made.alpha.sum()).backward()
    for name in PARAMETERS:
        assert not bool(getattr(own, name).grad[1].any())
    assert bool(own.means.grad[0].any())


@both
def test_long_ones_are_counted_once(dtype: torch.dtype, room: float) -> None:
    # Marching on by an epsilon meets them again where the error of their entry point is larger.
    count = 5
    needles = Gaussians(
        means=torch.linspace(-0.02, 0.02, count)[:, None] * torch.tensor([1.0, 1.0, 0.0]),
        quats=torch.tensor([[1.0, 0.001, 0.002, 0.0]]).repeat(count, 1),
        scales=torch.tensor([[0.05, 0.05, 500.0]]).repeat(count, 1),
        opacities=torch.full((count,), 0.2),
        sh=torch.zeros(count, 1, 3),
    ).to(dtype)
    origins = torch.tensor([[0.0, 0.0, -3000.0]]).repeat(400, 1)
    origins[:, :2] = 0.02 * torch.randn(400, 2, generator=torch.Generator().manual_seed(0))
    directions = torch.tensor([[0.0, 0.0, 1.0]]).repeat(400, 1)

    def seen(kind: torch.dtype):
        rays = Rays(origins=origins.to(kind), directions=directions.to(kind))
        return answers(needles.to(kind), rays, light_cutoff=1e-6)

    made, want = seen(dtype), seen(torch.float64)
    assert int(made.hits.max()) <= count
    assert torch.equal(made.hits, want.hits)
    torch.testing.assert_close(made.alpha.double(), want.alpha, rtol=0, atol=max(room, 1e-12))


def test_rounding_of_shapes_moves_no_sample_across_the_cutoff() -> None:
    sheet = replace(
        sphere(opacity=0.9, dtype=torch.float32),
        scales=torch.tensor([[0.003, 0.3, 0.03]]),
        quats=torch.tensor([[0.7, -0.3, 0.5, 0.2]]),
    )
    generator = torch.Generator().manual_seed(0)
    origins = 0.1 * torch.randn(20_000, 3, generator=generator)
    toward = sheet.means + 0.3 * torch.randn(20_000, 3, generator=generator) - origins
    rays = Rays(origins=origins, directions=toward)
    exact = Rays(origins=rays.origins.double(), directions=rays.directions.double())
    alpha = answers(sheet.to(torch.float64), exact, alpha_cutoff=1e-6).alpha
    close = ((alpha / CUTOFF - 1).abs() < 0.05) & ((alpha / CUTOFF - 1).abs() > 2e-4)
    assert int(close.sum()) > 30
    assert torch.equal(answers(sheet, rays).hits[close] > 0, alpha[close] > CUTOFF)


@both
def test_behind_what_is_opaque_there_is_light_and_a_gradient(
    dtype: torch.dtype, room: float
) -> None:
    settings = TraceSettings()
    assert settings.light_cutoff == pytest.approx((1 - settings.alpha_max) ** 2)
    wall = concatenate([sphere((0.0, 0.0, 2.0 + i), opacity=1.0, dtype=dtype) for i in range(2)])
    own = leaves(wall)
    made = answers(own, ray(dtype=dtype))
    made.rgb.sum().backward()
    for name in PARAMETERS:
        assert bool(torch.isfinite(getattr(own, name).grad).all())
    behind = own.sh.grad[1, 0, 0] / own.sh.grad[0, 0, 0]
    assert behind.item() == pytest.approx(0.01, abs=room)


@both
def test_a_sheet_of_no_thickness_is_a_sheet(dtype: torch.dtype, room: float) -> None:
    flat = replace(sphere(dtype=dtype), scales=torch.tensor([[0.1, 0.1, 0.0]], dtype=dtype))
    made = answers(flat, ray((0.05, 0.0, 0.0), (0.0, 0.1, 1.0), dtype))
    # The ray crosses the sheet 0.05 and 0.2 from its middle.
    assert made.alpha.item() == pytest.approx(0.8 * math.exp(-(0.25 + 4) / 2), abs=1e-6)
    assert made.distance.item() == pytest.approx(2 * math.hypot(1.0, 0.1), abs=1e-6)


@both
@pytest.mark.parametrize("factor", [-1.0, 7.0, 1e-10, 1e10])
def test_quaternions_need_not_be_unit(factor: float, dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(dtype=dtype), bundle(dtype=dtype)
    made, want = answers(replace(cloud, quats=factor * cloud.quats), rays), answers(cloud, rays)
    assert int(want.hits.sum()) > 20
    torch.testing.assert_close(made.rgb, want.rgb, rtol=0, atol=10 * room)


@both
def test_beyond_180_degrees_rays_see_what_lies_behind_the_axis(
    dtype: torch.dtype, room: float
) -> None:
    angles = torch.deg2rad(torch.tensor([0.0, 80.0, 100.0, 110.0, 179.0], dtype=torch.float64))
    toward = torch.stack([angles.sin(), torch.zeros_like(angles), angles.cos()], 1).to(dtype)
    near = concatenate(
        [sphere(tuple((2.0 * d).tolist()), rgb=(1.0, 0.0, 0.0), dtype=dtype) for d in toward]
    )
    far = concatenate(
        [sphere(tuple((3.0 * d).tolist()), rgb=(0.0, 0.0, 1.0), dtype=dtype) for d in toward]
    )
    made = answers(concatenate([far, near]), Rays(origins=0 * toward, directions=toward))
    # By distance: by z the far ones would come first where z is negative.
    want = torch.tensor([[0.8, 0.0, 0.16]], dtype=dtype).expand(5, 3)
    torch.testing.assert_close(made.rgb, want, rtol=0, atol=10 * room)
    assert made.hits.tolist() == [2] * 5
    assert made.median_distance.tolist() == pytest.approx([2.0] * 5, abs=10 * room)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_refused(dtype: torch.dtype) -> None:
    cloud, rays = scene(dtype=torch.float32), bundle(dtype=torch.float32, times=True)
    with pytest.raises(ShapeError, match="expected one dtype, float32 or float64"):
        trace(cloud.to(dtype), rays)
    with pytest.raises(ShapeError, match="expected one dtype, float32 or float64"):
        Rays(origins=rays.origins.to(dtype), directions=rays.directions.to(dtype))
    with pytest.raises(ShapeError, match="expected one dtype, float32 or float64"):
        trace(cloud, rays, moving=motion(dtype=dtype))


@both
def test_nothing_is_computed_in_half_precision(dtype: torch.dtype, room: float) -> None:
    cloud, rays = scene(dtype=dtype), bundle(dtype=dtype)
    want = answers(cloud, rays).rgb
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(answers(cloud, rays).rgb, want)


@both
def test_directions_from_a_lens_to_its_focus_need_not_be_unit(
    dtype: torch.dtype, room: float
) -> None:
    starts = torch.tensor([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]], dtype=dtype)
    focus = torch.tensor([[0.0, 0.0, 2.0]], dtype=dtype)
    made = answers(sphere(dtype=dtype), Rays(origins=starts, directions=5 * (focus - starts)))
    assert made.distance.tolist() == pytest.approx([2.0, math.hypot(2.0, 0.3)], abs=10 * room)
    assert made.alpha.tolist() == pytest.approx([0.8, 0.8], abs=room)
