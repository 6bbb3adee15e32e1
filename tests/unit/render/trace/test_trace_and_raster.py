"""Pinhole rays next to the rasteriser: as close as its linearisation allows.

A footprint of EWA is off by about 2 r tan(angle) in alpha, r = scale / distance, and much less on
the axis. Where its alpha is at the cutoff one of them may have nothing. Depth of the rasteriser is
z, ours is along the ray.
"""

import math
from dataclasses import replace

import pytest
import torch
from oracles_trace import scene
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.rays import world_rays
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

RASTER = RenderSettings(dilation_px2=0.0, alpha_max=0.99, light_cutoff=1e-4)
TRACED = TraceSettings(color_direction="mean")


def rays_of(camera: Camera) -> Rays:
    origins, directions = world_rays(camera)
    return Rays(origins=origins.flatten(0, 1), directions=directions.flatten(0, 1))


def images(cloud: Gaussians, camera: Camera) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """(rgb, alpha) traced and rasterised."""
    made = trace(cloud, rays_of(camera), outputs=("rgb", "alpha"), settings=TRACED)
    drawn = render(cloud, camera, outputs=("rgb", "alpha"), settings=RASTER)
    size = camera.size_px
    return made.rgb.unflatten(0, size), made.alpha.unflatten(0, size), drawn.rgb, drawn.alpha


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 40.0])
@pytest.mark.parametrize("ratio", [0.001, 0.01])
def test_one_sphere_is_as_close_as_the_linearisation(ratio: float, angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    mean = torch.tensor([[3 * math.sin(angle), 0.0, 3 * math.cos(angle)]])
    one = scene(1, dtype=torch.float32, bands=1)
    one = replace(one, means=mean, scales=torch.full((1, 3), 3 * ratio), opacities=torch.ones(1))
    # About ten pixels per standard deviation, and the image around the sphere.
    focal = 10 / ratio * math.cos(angle)
    camera = pinhole(focal, (81, 81), torch.float32)
    center = torch.tensor([40.5 - focal * math.tan(angle), 40.5])
    camera = replace(camera, center_px=center)
    _, traced, _, drawn = images(one, camera)
    budget = 2 * ratio * math.tan(angle) + 3e-4
    assert float(drawn.max()) > 0.95
    off = (traced - drawn).abs()
    assert float(off.max()) < budget + 1 / 255
    assert float(off[(traced > 0) & (drawn > 0)].max()) < budget


def test_a_cloud_of_small_ones_looks_the_same() -> None:
    generator = torch.Generator().manual_seed(0)
    count, ratio = 400, 0.004
    depth = 2 + 2 * torch.rand(count, 1, generator=generator)
    tangent = torch.rand(count, 2, generator=generator) - 0.5
    cloud = scene(count, dtype=torch.float32, bands=4)
    cloud = replace(
        cloud,
        means=torch.cat([tangent * depth, depth], 1),
        scales=ratio * depth * (0.5 + torch.rand(count, 3, generator=generator)),
    )
    camera = pinhole(300.0, (300, 300), torch.float32)
    rgb, alpha, drawn_rgb, drawn_alpha = images(cloud, camera)
    assert float(drawn_alpha.mean()) > 0.02
    # Half a right angle is the diagonal; scales reach 1.5 ratios.
    budget = 2 * 1.5 * ratio * math.sqrt(0.5) + 1 / 255
    assert float((alpha - drawn_alpha).abs().max()) < 1.2 * budget
    assert float((rgb - drawn_rgb).abs().mean()) < 1e-4


def test_distances_are_depths_along_the_rays() -> None:
    cloud = scene(1, dtype=torch.float32, bands=1)
    cloud = replace(
        cloud,
        means=torch.tensor([[0.8, -0.5, 3.0]]),
        scales=torch.full((1, 3), 0.01),
        opacities=torch.tensor([0.9]),
    )
    camera = pinhole(200.0, (200, 200), torch.float32)
    rays = rays_of(camera)
    made = trace(cloud, rays, outputs=("distance", "alpha"), settings=TRACED)
    drawn = render(cloud, camera, outputs=("depth", "alpha"), settings=RASTER)
    z = (made.distance * rays.directions[:, 2]).unflatten(0, camera.size_px)
    seen = (made.alpha.unflatten(0, camera.size_px) > 0.1) & (drawn.alpha > 0.1)
    assert int(seen.sum()) > 3
    torch.testing.assert_close(z[seen], drawn.depth[seen], rtol=5e-3, atol=0)
