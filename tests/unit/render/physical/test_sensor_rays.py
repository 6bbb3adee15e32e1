"""Rays of a sensor: directions, times, lenses, poses and what does not exist, by the formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_physical import Ideal, aperture_ray, camera_of, dots, lens_direction, ray_time

from diff4splat.geometry import quaternion
from diff4splat.geometry.lenses.build import equirectangular_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.physical.effects import find_effects
from diff4splat.render.physical.sampling import draw
from diff4splat.render.physical.sensor import Draws, SensorRays, sensor_rays
from diff4splat.render.physical.settings import PhotoSettings

F64 = torch.float64
SIZE = (5, 6)
PIXELS = torch.arange(30)


def own_camera():
    """Off-centre, unequal focal lengths, turned and away from the origin."""
    camera = camera_of(SIZE, 20.0, F64)
    pose = torch.eye(4, dtype=F64)
    pose[:3, :3] = quaternion.to_matrix(torch.tensor([0.9, 0.1, -0.3, 0.2], dtype=F64))
    pose[:3, 3] = torch.tensor([1.0, -2.0, 0.5], dtype=F64)
    return replace(
        camera,
        focal_px=torch.tensor([5.0, 7.0], dtype=F64),
        center_px=torch.tensor([2.7, 2.2], dtype=F64),
        world_from_camera=pose,
    )


def some_draws(samples: int = 3) -> Draws:
    generator = torch.Generator().manual_seed(4)
    numbers = torch.rand(30, samples, 5, generator=generator, dtype=F64)
    return Draws(
        in_pixel=numbers[..., :2] - 0.5,
        on_lens=0.7 * (2 * numbers[..., 2:4] - 1),
        in_exposure=numbers[..., 4],
    )


@pytest.mark.parametrize("timestamp", ["middle", "start"])
@pytest.mark.parametrize("surface", ["plane", "sphere"])
@pytest.mark.parametrize("fisheye", [None, (0.02, -0.01, 0.003, 0.0)], ids=["pinhole", "fisheye"])
def test_every_ray_is_that_of_the_formulas(surface: str, fisheye, timestamp: str) -> None:
    lens = (
        Pinhole() if fisheye is None
        else OpenCVFisheye(coefficients=torch.tensor(fisheye, dtype=F64))
    )  # fmt: skip
    optics = Optics(
        lens=lens,
        aperture=Aperture(radius=0.2, focus_distance=3.0, surface=surface),
        shutter=Shutter(readout_s=0.03, direction="right-to-left"),
        exposure_s=0.01,
        timestamp=timestamp,
    )
    ideal = Ideal(
        radius=0.2, focus=3.0, sphere=surface == "sphere", readout_s=0.03,
        direction="right-to-left", exposure_s=0.01, starts=timestamp == "start", fisheye=fisheye,
    )  # fmt: skip
    camera, draws = own_camera(), some_draws()
    rays = sensor_rays(PhysicalCamera(camera=camera, optics=optics), PIXELS, draws, 0.0, True)
    pose = camera.world_from_camera.numpy()
    for pixel in range(30):
        row, column = divmod(pixel, 6)
        for s in range(3):
            place = np.array([column + 0.5, row + 0.5]) + draws.in_pixel[pixel, s].numpy()
            point = (place - camera.center_px.numpy()) / camera.focal_px.numpy()
            direction = lens_direction(*point, ideal)
            start, ahead = aperture_ray(direction, draws.on_lens[pixel, s].numpy(), ideal)
            want = ray_time(row, column, SIZE, float(draws.in_exposure[pixel, s]), ideal)
            assert float(rays.offset_s[pixel, s]) == pytest.approx(want, abs=1e-15)
            np.testing.assert_allclose(
                rays.origins[pixel, s], pose[:3, :3] @ start + pose[:3, 3], atol=1e-12
            )
            np.testing.assert_allclose(rays.directions[pixel, s], pose[:3, :3] @ ahead, atol=1e-9)
            assert float(rays.along[pixel, s]) == pytest.approx(ahead[2], abs=1e-9)
    assert bool(rays.exists.all())


def plain(optics: Optics, draws: Draws | None = None, **others) -> SensorRays:
    camera = PhysicalCamera(camera=others.pop("camera", own_camera()), optics=optics, **others)
    return sensor_rays(camera, PIXELS, draws or Draws(), 0.0, True)


def test_without_effects_there_is_one_ray_per_pixel_from_the_camera() -> None:
    rays = plain(Optics())
    assert rays.origins.shape == (30, 1, 3)
    assert torch.equal(rays.origins[:, 0], own_camera().position.expand(30, 3))
    assert not rays.offset_s.any()


@pytest.mark.parametrize("surface", ["plane", "sphere"])
def test_rays_of_a_pixel_meet_where_it_is_in_focus(surface: str) -> None:
    aperture = Aperture(radius=0.3, focus_distance=2.5, surface=surface)
    draws = Draws(on_lens=some_draws(6).on_lens)
    camera = replace(own_camera(), world_from_camera=torch.eye(4, dtype=F64))
    rays = plain(Optics(aperture=aperture), draws, camera=camera)
    middle = plain(Optics(), camera=camera).directions
    z = middle[..., 2:] if surface == "plane" else torch.ones_like(middle[..., 2:])
    focal = (2.5 / z * middle).expand(30, 6, 3)
    reach = (focal - rays.origins).norm(dim=-1, keepdim=True)
    torch.testing.assert_close(rays.origins + reach * rays.directions, focal)
    torch.testing.assert_close(rays.directions.norm(dim=-1), torch.ones(30, 6, dtype=F64))
    assert not rays.origins[..., 2].any()


def test_beyond_the_plane_in_focus_there_are_no_rays() -> None:
    camera = equirectangular_camera(SIZE, F64)
    lens, draws = Equirectangular(), Draws(on_lens=some_draws(2).on_lens)
    flat = Optics(lens=lens, aperture=Aperture(radius=0.1, focus_distance=1.0))
    around = replace(flat, aperture=replace(flat.aperture, surface="sphere"))
    ahead = plain(Optics(lens=lens), camera=camera).directions[..., 2] > 1e-3
    assert torch.equal(plain(flat, draws, camera=camera).exists, ahead.expand(30, 2))
    assert bool(plain(around, draws, camera=camera).exists.all())
    for optics in (flat, around):
        rays = plain(optics, draws, camera=camera)
        assert bool(torch.isfinite(rays.directions).all() and torch.isfinite(rays.origins).all())


def test_every_ray_starts_where_the_camera_is_at_its_time() -> None:
    poses = torch.eye(4, dtype=F64).repeat(2, 1, 1)
    poses[1, :3, 3] = torch.tensor([4.0, 0.0, -2.0], dtype=F64)
    track = PoseTrack(times_s=torch.tensor([9.0, 11.0], dtype=F64), world_from_camera=poses)
    optics = Optics(shutter=Shutter(readout_s=0.8), exposure_s=0.4)
    camera = PhysicalCamera(camera=own_camera(), optics=optics, track=track)
    rays = sensor_rays(camera, PIXELS, Draws(in_exposure=some_draws().in_exposure), 10.0, True)
    want = (0.5 + 0.5 * rays.offset_s)[..., None] * poses[1, :3, 3]
    torch.testing.assert_close(rays.origins, want)
    assert float(rays.offset_s.max() - rays.offset_s.min()) > 0.8


def test_where_lines_do_not_differ_all_are_read_in_the_middle() -> None:
    for timestamp, want in (("middle", 0.0), ("start", 0.025)):
        optics = Optics(shutter=Shutter(readout_s=0.04), exposure_s=0.01, timestamp=timestamp)
        camera = PhysicalCamera(camera=own_camera(), optics=optics)
        rays = sensor_rays(camera, PIXELS, Draws(), 0.0, False)
        torch.testing.assert_close(rays.offset_s, torch.full((30, 1), want, dtype=F64))


def test_draws_are_those_of_the_effects() -> None:
    aperture = Aperture(radius=0.1, focus_distance=1.0)
    camera = PhysicalCamera(camera=own_camera(), optics=Optics(aperture=aperture))
    settings = PhotoSettings(samples=16, pixel_area=True)
    effects = find_effects(dots([]), camera, 0.0, settings)
    made = draw(effects, PIXELS, seed=3)
    assert made.in_exposure is None
    assert made.on_lens.shape == made.in_pixel.shape == (30, 16, 2)
    assert float(made.on_lens.norm(dim=-1).max()) <= 1
    assert float(made.in_pixel.abs().max()) <= 0.5
    part = draw(effects, PIXELS[7:9], seed=3)
    assert torch.equal(part.on_lens, made.on_lens[7:9])
    # In 16 strata of equal size of a pixel's width lies one sample each.
    strata = ((made.in_pixel[..., 0] + 0.5) * 16).floor().sort(1).values
    assert torch.equal(strata, torch.arange(16, dtype=F64).expand(30, 16))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_rays_have_the_dtype_of_the_camera(dtype: torch.dtype) -> None:
    optics = Optics(
        aperture=Aperture(radius=0.2, focus_distance=3.0),
        shutter=Shutter(readout_s=math.pi / 100),
        exposure_s=0.01,
    )
    poses = torch.eye(4, dtype=F64).repeat(2, 1, 1)
    poses[1, 0, 3] = 1.0
    track = PoseTrack(times_s=torch.tensor([-1.0, 1.0], dtype=F64), world_from_camera=poses)
    for own in (None, track):
        camera = PhysicalCamera(camera=own_camera(), optics=optics, track=own).to(dtype)
        rays = sensor_rays(camera, PIXELS, some_draws(), 0.0, True)
        for value in (rays.origins, rays.directions, rays.offset_s, rays.along):
            assert value.dtype == dtype
