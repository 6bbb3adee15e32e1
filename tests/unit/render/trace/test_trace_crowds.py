"""Crowds: equal places, overlap out of order, light that runs out, and cameras far apart."""

from dataclasses import replace

import pytest
import torch
from oracles_trace import (
    answers,
    assert_as_the_oracle,
    brute_force,
    bundle,
    ray,
    scene,
    sphere,
)

from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings

both = pytest.mark.parametrize(
    "dtype", [torch.float64, torch.float32], ids=["reference", "compiled"]
)
COUNT = 24


@both
def test_a_crowd_at_one_place_is_blended_by_index(dtype: torch.dtype) -> None:
    crowd = sphere(opacity=0.01, dtype=dtype).select(torch.zeros(900, dtype=torch.long))
    shades = torch.linspace(-1.5, 1.5, 900, dtype=dtype)[:, None, None].expand(900, 1, 3)
    made = answers(replace(crowd, sh=shades), ray(dtype=dtype))
    weights = 0.01 * 0.99 ** torch.arange(900, dtype=torch.float64)
    colors = (0.5 + 0.28209479177387814 * shades[:, 0, 0].double()).clamp_min(0)
    assert made.hits.item() == 900
    assert made.rgb[0, 0].item() == pytest.approx(float((weights * colors).sum()), abs=1e-6)


def test_many_that_overlap_out_of_order_are_put_in_order() -> None:
    # Large ones whose peaks have nothing to do with where they begin: a heap sorts their hits.
    generator = torch.Generator().manual_seed(0)
    depth = 5 + 3 * torch.rand(2000, generator=generator)
    aside = 4 * torch.randn(2000, 2, generator=generator)
    cloud = scene(1, dtype=torch.float32, bands=1).select(torch.zeros(2000, dtype=torch.long))
    cloud = replace(
        cloud,
        means=torch.cat([aside, depth[:, None]], 1),
        scales=torch.tensor([3.0, 3.0, 1.5]) * (0.5 + torch.rand(2000, 1, generator=generator)),
        quats=torch.randn(2000, 4, generator=generator),
        opacities=torch.full((2000,), 0.02),
        sh=torch.rand(2000, 1, 3, generator=generator),
    )
    rays = bundle(70, dtype=torch.float32)
    rays = Rays(origins=rays.origins, directions=rays.directions * 0.1 + torch.tensor([0, 0, 1.0]))
    settings = {"light_cutoff": 1e-3, "near_distance": 0.2}
    got = answers(cloud, rays, **settings)
    want = answers(
        cloud.to(torch.float64),
        Rays(origins=rays.origins.double(), directions=rays.directions.double()),
        **settings,
    )
    assert float(got.hits.double().mean()) > 300
    torch.testing.assert_close(got.rgb.double(), want.rgb, rtol=0, atol=2e-4)


def test_light_runs_out_no_sooner_than_it_should() -> None:
    # Slanted opaque sheets: rays meet them far in front of and behind their means.
    generator = torch.Generator().manual_seed(3)
    count = 3000
    cloud = scene(count, dtype=torch.float32, bands=1)
    place = torch.rand(count, 3, generator=generator)
    cloud = replace(
        cloud,
        means=place * torch.tensor([2.0, 2.0, 1.0]) - torch.tensor([1.0, 1.0, -3.0]),
        scales=torch.tensor([0.3, 0.3, 0.01]).repeat(count, 1),
        opacities=0.1 + 0.9 * torch.rand(count, generator=generator),
        sh=torch.rand(count, 1, 3, generator=generator),
    )
    rays = bundle(128, dtype=torch.float32)
    toward = 0.1 * rays.directions + torch.tensor([0.0, 0.0, 1.0])
    rays = Rays(origins=torch.zeros_like(toward), directions=toward)
    got = answers(cloud, rays)
    want = answers(
        cloud.to(torch.float64),
        Rays(origins=rays.origins.double(), directions=rays.directions.double()),
    )
    assert float(want.alpha.min()) > 0.999
    assert float((got.hits == want.hits).double().mean()) > 0.97
    assert float((got.rgb.double() - want.rgb).abs().median()) < 1e-6


def test_far_cameras_that_look_the_same_way_share_no_rounding() -> None:
    # One looks at tiny spheres nearby, the other stands a thousand units behind it.
    cloud = scene(COUNT, dtype=torch.float32)
    cloud = replace(
        cloud,
        means=0.01 * cloud.means + torch.tensor([0.0, 0.0, 0.1]),
        scales=torch.full((COUNT, 3), 1e-4),
        opacities=torch.full((COUNT,), 0.9),
    )
    directions = torch.cat([cloud.means, torch.tensor([[0.0, 0.0, 1.0]]).repeat(COUNT, 1)])
    directions[:COUNT, 0] += 1e-4
    origins = torch.zeros_like(directions)
    origins[COUNT:, 2] = -1000.0
    rays = Rays(origins=origins, directions=directions)
    got = answers(cloud, rays, near_distance=0.0)
    want = brute_force(cloud, rays, TraceSettings(near_distance=0.0))
    assert want.alpha[:COUNT].mean() > 0.3
    assert_as_the_oracle(got, want, 2e-5)
