"""The same pinhole by rays and by the rasteriser: as close as its linearisation and dilation allow.

A footprint of EWA is off by about 2 r tan(angle) in alpha, r = scale / distance. Smoothing widens
by 0.3 square pixels at the distance, dilation by 0.3 on the sensor: across the axis they are the
same, and at an angle a pixel covers cos² of the middle's angle along the radius and cos across it.
So the variance is off by a factor of up to cos⁻⁴ in 0.3 / σ² of it, and alpha by at most
½ e⁻¹ · 2 of half of that.
"""

import math
from dataclasses import replace

import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, shot
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.settings import RenderSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

TRACE = TraceSettings(color_direction="mean")
RASTER = RenderSettings(alpha_max=0.99, light_cutoff=1e-4)
CUTOFF = 1 / 255


def both(cloud: Gaussians, camera: Camera, smoothing_px2: float) -> tuple[Tensor, Tensor]:
    """Alpha by rays and by the rasteriser."""
    settings = PhotoSettings(
        smoothing_px2=smoothing_px2, trace=TRACE, raster=replace(RASTER, dilation_px2=smoothing_px2)
    )
    traced, drawn = (shot(cloud, camera, None, settings, backend=b) for b in ("trace", "auto"))
    assert (traced.backend, drawn.backend) == ("trace", "raster")
    return traced.alpha, drawn.alpha


def one(ratio: float, angle_deg: float, pixels_per_deviation: float) -> tuple[Gaussians, Camera]:
    """A sphere at an angle, and the image around it."""
    angle = math.radians(angle_deg)
    ball = dots([(3 * math.sin(angle), 0.0, 3 * math.cos(angle))], 3 * ratio, opacity=1.0)
    focal = pixels_per_deviation / ratio * math.cos(angle)
    camera = camera_of((41, 41), focal)
    center = torch.tensor([20.5 - focal * math.tan(angle), 20.5])
    return ball, replace(camera, center_px=center)


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 40.0])
@pytest.mark.parametrize("ratio", [0.001, 0.01])
def test_without_dilation_only_linearisation_differs(ratio: float, angle_deg: float) -> None:
    traced, drawn = both(*one(ratio, angle_deg, 5.0), 0.0)
    budget = 2 * ratio * math.tan(math.radians(angle_deg)) + 3e-4
    off = (traced - drawn).abs()
    assert float(drawn.max()) > 0.95
    assert float(off.max()) < budget + CUTOFF
    assert float(off[(traced > 0) & (drawn > 0)].max()) < budget


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 40.0])
@pytest.mark.parametrize("pixels", [0.5, 1.0, 3.0])
def test_smoothing_is_dilation_on_the_axis_and_near_it_elsewhere(
    pixels: float, angle_deg: float
) -> None:
    ball, camera = one(0.003, angle_deg, pixels)
    traced, drawn = both(ball, camera, 0.3)
    angle = math.radians(angle_deg)
    # A pixel is that of the middle of the image, which is at the angle, in the rays' smoothing.
    variance = pixels**2
    stretched = abs(math.cos(angle) ** -4 - math.cos(angle) ** 4) * 0.3 / (variance + 0.3)
    budget = 2 * 0.003 * math.tan(angle) + 3e-4 + math.exp(-1) * stretched
    off = (traced - drawn).abs()
    assert float(off.max()) < budget + CUTOFF
    if angle_deg == 0:
        assert float(off[(traced > 0) & (drawn > 0)].max()) < 2e-3


def test_a_cloud_of_small_ones_is_as_close() -> None:
    generator = torch.Generator().manual_seed(0)
    count, ratio = 150, 0.004
    depth = 2 + 2 * torch.rand(count, 1, generator=generator)
    tangent = 0.6 * (torch.rand(count, 2, generator=generator) - 0.5)
    cloud = replace(
        dots([(0, 0, 1)] * count),
        means=torch.cat([tangent * depth, depth], 1),
        scales=ratio * depth * (0.5 + torch.rand(count, 3, generator=generator)),
    )
    camera = camera_of((90, 90), 150.0)
    for smoothing in (0.0, 0.3):
        traced, drawn = both(cloud, camera, smoothing)
        budget = 2 * 1.5 * ratio * 0.3 * math.sqrt(2) + CUTOFF
        # Dilated variances: cos⁻⁴ at 23 degrees, of footprints of at least 0.3 + 0.3 px².
        budget += math.exp(-1) * 0.35 * 0.5 * (smoothing > 0)
        assert float((traced - drawn).abs().max()) < budget
        assert float((traced - drawn).abs().mean()) < budget / 20
        assert float(drawn.mean()) > 0.02


def test_thin_ones_do_not_vanish() -> None:
    # A hair a hundredth of a pixel wide between two columns of pixel centres.
    hair = replace(dots([(0.02, 0, 4)]), scales=torch.tensor([[4e-4, 1.0, 4e-4]]))
    camera = camera_of((33, 41))
    smooth = shot(hair, camera, None, PhotoSettings(), backend="trace").alpha
    sharp = shot(hair, camera, None, SHARP, backend="trace").alpha
    drawn = shot(hair, camera, None, PhotoSettings()).alpha
    assert float(sharp.sum()) == 0.0
    assert float(smooth[16].sum()) > 0.5
    torch.testing.assert_close(smooth[16], drawn[16], rtol=0, atol=0.02)


@pytest.mark.parametrize("name", ["depth", "median_depth", "distance"])
def test_distances_agree(name: str) -> None:
    ball, camera = dots([(0.4, -0.2, 4)], 0.08), camera_of((33, 41))
    images = [
        shot(ball, camera, None, PhotoSettings(trace=TRACE), outputs=("alpha", name), backend=b)
        for b in ("trace", "auto")
    ]
    seen = (images[0].alpha > 0.6) & (images[1].alpha > 0.6)
    assert int(seen.sum()) > 5
    traced, drawn = (getattr(image, name)[seen] for image in images)
    torch.testing.assert_close(traced, drawn, rtol=3e-3, atol=0)
