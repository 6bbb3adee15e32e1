"""Finite answers and gradients, and right ones, where numbers and sizes are extreme."""

import math
from dataclasses import replace

import pytest
import torch
from oracles_trace import (
    MOTION,
    PARAMETERS,
    answers,
    assert_as_the_oracle,
    brute_force,
    bundle,
    leaves,
    motion,
    ray,
    scene,
)
from torch import Tensor

from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceOutput, TraceSettings
from diff4splat.scene.gaussians import Gaussians

both = pytest.mark.parametrize(
    "dtype", [torch.float64, torch.float32], ids=["reference", "compiled"]
)
LARGEST = 1.8e19
COUNT = 24


def some(**changes: object) -> Gaussians:
    """Gaussians around the origin, with some parameters replaced by one value."""
    cloud = scene(COUNT, dtype=torch.float32)
    values = {
        name: torch.as_tensor(value, dtype=torch.float32).expand(getattr(cloud, name).shape)
        for name, value in changes.items()
    }
    return replace(cloud, **values)


def assert_finite(
    cloud: Gaussians,
    rays: Rays,
    dtype: torch.dtype,
    moving: MovingCloud | None = None,
    **settings: object,
) -> TraceOutput:
    """Every answer, and every gradient of everything."""
    own = leaves(cloud.to(dtype))
    start, toward = (
        values.to(dtype).clone().requires_grad_() for values in (rays.origins, rays.directions)
    )
    motion_leaves = None
    if moving is not None:
        cast = {name: getattr(moving, name).to(dtype) for name in MOTION}
        motion_leaves = leaves(replace(moving, **cast))
    time_s = None if rays.time_s is None else rays.time_s.to(dtype).requires_grad_()
    looking = Rays(origins=start, directions=toward, time_s=time_s)
    made = answers(own, looking, motion_leaves, **settings)
    images = (made.rgb, made.distance, made.median_distance, made.alpha)
    sum(image.mean() for image in images).backward()
    found = [*images, start.grad, toward.grad, *(getattr(own, n).grad for n in PARAMETERS)]
    if motion_leaves is not None:
        found += [getattr(motion_leaves, name).grad for name in MOTION]
        found.append(time_s.grad)
    assert all(bool(torch.isfinite(value).all()) for value in found if value is not None)
    assert bool(((made.alpha >= 0) & (made.alpha <= 1)).all())
    return made


THIN = torch.tensor([1e-6, 1.0, 1e3])
CASES = {
    "no light is too little": (some(scales=100.0, opacities=1.0), {"light_cutoff": 1e-30}),
    "half the light is too little": (some(), {"light_cutoff": 0.5}),
    "the faintest count": (some(), {"alpha_cutoff": 1e-12}),
    "fainter than float64": (some(), {"alpha_cutoff": 1e-300}),
    "only the opaque count": (some(opacities=1.0), {"alpha_cutoff": 0.98}),
    "all but opaque": (some(opacities=1.0), {"alpha_max": 0.9999999, "light_cutoff": 1e-30}),
    "opaque once rounded": (some(opacities=2.0), {"alpha_max": 1 - 1e-9}),
    "clear": (some(opacities=0.0), {}),
    "less than clear": (some(opacities=-1.0), {}),
    "opaque": (some(opacities=1.0), {}),
    "far beyond opaque": (some(opacities=LARGEST), {}),
    "tiny": (some(scales=1e-6), {}),
    "tinier than anything": (some(scales=1e-30), {}),
    "of no size": (some(scales=0.0), {}),
    "negative scales": (some(scales=-0.3), {}),
    "large": (some(scales=1e3), {}),
    "needles and sheets": (some(scales=THIN), {}),
    "needles of the flatter kernel": (some(scales=THIN), {"kernel_degree": 4}),
    "beyond all else": (some(scales=1e15), {}),
    "no quaternions": (some(quats=0.0), {}),
    "tiny quaternions": (some(quats=1e-30), {}),
    "large quaternions": (some(quats=1e18), {}),
    "coincident": (some(means=2.0, scales=0.5), {}),
    "in one plane": (some(means=torch.tensor([0.0, 0.0, 2.0])), {}),
    "where rays begin": (some(means=0.0, scales=0.5), {}),
    "a world away": (some(means=1e18), {}),
    "bright": (some(sh=1e15), {}),
    "dark": (some(sh=-1e15), {}),
    "all is near": (some(), {"near_distance": 1e30}),
    "nothing is near": (some(scales=1.0), {"near_distance": 0.0}),
}


@both
@pytest.mark.parametrize("name", CASES)
def test_everything_stays_finite(name: str, dtype: torch.dtype) -> None:
    cloud, settings = CASES[name]
    rays = bundle(30, dtype=torch.float32)
    aimed = cloud.means[:12].clamp(-1e6, 1e6) - rays.origins[:12] + 1e-3
    rays = Rays(origins=rays.origins, directions=torch.cat([aimed, rays.directions[12:]]))
    assert_finite(cloud, rays, dtype, **settings)
    if settings.get("color_direction") is None:
        assert_finite(cloud, rays, dtype, color_direction="mean", **settings)


@both
@pytest.mark.parametrize("deviation", [1e-6, 1.0, 1e6, math.inf])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 1e3])
def test_everything_that_moves_stays_finite(
    speed: float, deviation: float, dtype: torch.dtype
) -> None:
    moving = motion(COUNT, dtype=torch.float32)
    moving = replace(
        moving,
        velocities=speed * moving.velocities,
        time_deviations_s=torch.full((COUNT,), deviation),
    )
    assert_finite(some(), bundle(30, dtype=torch.float32, times=True), dtype, moving)


@both
@pytest.mark.parametrize("thin", [1e-6, 1e-4, 1e-2])
def test_thin_ones_are_right(thin: float, dtype: torch.dtype) -> None:
    # Rays aim at points of needles and sheets, and past them.
    cloud = some(scales=torch.tensor([thin, 0.5, 0.5]), opacities=0.7)
    rays = bundle(48, dtype=torch.float32)
    shift = 0.1 * rays.origins[:COUNT]
    aimed = cloud.means + shift - rays.origins[:COUNT]
    rays = Rays(origins=rays.origins, directions=torch.cat([aimed, rays.directions[COUNT:]]))
    cloud, rays = cloud.to(dtype), Rays(
        origins=rays.origins.to(dtype), directions=rays.directions.to(dtype)
    )  # fmt: skip
    made = answers(cloud, rays)
    want = brute_force(cloud, rays, TraceSettings())
    assert int(made.hits.sum()) > 20
    # The inverse of the oracle's covariance loses digits as the square of the thinness.
    assert_as_the_oracle(made, want, max(1e-5, 1e-17 / thin**2))


@both
def test_scales_of_nine_decades_in_one_scene(dtype: torch.dtype) -> None:
    powers = torch.linspace(-6, 3, COUNT)
    cloud = some(opacities=0.3)
    cloud = replace(cloud, scales=(10**powers)[:, None].expand(-1, 3), sh=cloud.sh[:, :1])
    rays = bundle(COUNT, dtype=torch.float32)
    rays = Rays(origins=rays.origins, directions=cloud.means - rays.origins)
    cloud, rays = cloud.to(dtype), Rays(
        origins=rays.origins.to(dtype), directions=rays.directions.to(dtype)
    )  # fmt: skip
    # Float32 directions miss the smallest by more than their size.
    large = powers > -4
    made, want = answers(cloud, rays), brute_force(cloud, rays, TraceSettings())
    sure = (want.unsure == 0) & large.numpy()
    assert sure.sum() > 12
    got = made.alpha.double().numpy()
    assert abs(got - want.alpha)[sure].max() < 2e-5


@both
def test_a_million_units_away_shapes_are_kept(dtype: torch.dtype) -> None:
    # Places a multiple of 1/8 apart are exact in float32 there.
    cloud, rays = scene(COUNT), bundle(60)
    places = (8 * cloud.means).round() / 8
    starts = (8 * rays.origins).round() / 8
    cloud = replace(cloud, means=places)
    shift = torch.tensor([1048576.0, -524288.0, 262144.0], dtype=torch.float64)
    far = replace(cloud, means=places + shift).to(dtype)
    near, looking = cloud.to(dtype), rays.directions.to(dtype)
    want = answers(near, Rays(origins=starts.to(dtype), directions=looking), near_distance=0.2)
    got = answers(far, Rays(origins=(starts + shift).to(dtype), directions=looking),
                  near_distance=0.2)  # fmt: skip
    assert int(want.hits.sum()) > 50
    torch.testing.assert_close(got.rgb, want.rgb, rtol=0, atol=2e-6)


@both
@pytest.mark.parametrize("name", [*PARAMETERS, *MOTION])
@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e30])
def test_gaussians_with_unusable_numbers_are_left_out_and_counted(
    bad: float, name: str, dtype: torch.dtype
) -> None:
    cloud, moving = scene(COUNT, dtype=dtype), motion(COUNT, dtype=dtype)
    broken = torch.arange(COUNT) % 5 == 0
    if bad == 1e30 and dtype == torch.float64:
        bad = 1e200
    if name == "time_deviations_s":
        bad = math.nan if math.isnan(bad) else -1.0

    def spoiled(values: Tensor) -> Tensor:
        mask = broken.view(-1, *[1] * (values.ndim - 1))
        return torch.where(mask, torch.tensor(bad, dtype=dtype), values)

    rays, kept = bundle(20, dtype=dtype, times=True), (~broken).nonzero().squeeze(1)
    want = answers(cloud.select(kept), rays, moving.select(kept))
    if name in MOTION:
        moving = replace(moving, **{name: spoiled(getattr(moving, name))})
    else:
        cloud = replace(cloud, **{name: spoiled(getattr(cloud, name))})
    own = leaves(cloud)
    made = answers(own, rays, moving)
    assert made.dropped_nonfinite == int(broken.sum())
    assert made.dropped_by_parameter == {name: int(broken.sum())}
    torch.testing.assert_close(made.rgb, want.rgb)
    made.rgb.sum().backward()
    for parameter in PARAMETERS:
        assert bool(torch.isfinite(getattr(own, parameter).grad).all())


@both
def test_rays_all_alike_or_in_all_directions(dtype: torch.dtype) -> None:
    cloud = scene(COUNT, dtype=dtype)
    one = ray((0.1, 0.2, 0.3), (0.3, -0.2, 0.9), dtype)
    same = Rays(origins=one.origins.repeat(200, 1), directions=one.directions.repeat(200, 1))
    rgb = answers(cloud, same).rgb
    torch.testing.assert_close(rgb, rgb[:1].expand(200, 3), rtol=0, atol=1e-6)
    corners = torch.tensor(
        [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
    ).to(dtype)
    around = Rays(origins=torch.zeros_like(corners), directions=corners)
    want = brute_force(cloud, around, TraceSettings())
    assert_as_the_oracle(answers(cloud, around), want, 1e-5)
