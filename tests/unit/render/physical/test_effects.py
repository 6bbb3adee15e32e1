"""Nothing needless: what does not show is left out, and told."""

import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, drifting, keyed, scene_of, shot

from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.api import render
from diff4splat.render.physical.effects import Effects, find_effects
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.settings import RenderSettings

CLOUD = dots([(0, 0, 4), (0.2, -0.1, 5)], 0.1)
MOVING = drifting(CLOUD, (1.0, 0.0, 0.0), time_range_s=(0.0, 1.0))
BUSY = Optics(shutter=Shutter(readout_s=0.02), exposure_s=0.01)
STILL = "read-out and exposure: neither scene nor camera moves meanwhile"


def found(
    subject, optics: Optics, time_s: float = 0.5, track: PoseTrack | None = None, **settings
) -> Effects:
    camera = PhysicalCamera(camera=camera_of(), optics=optics, track=track)
    return find_effects(subject, camera, time_s, PhotoSettings(**settings))


def test_a_pinhole_is_drawn_as_ever() -> None:
    made = shot(
        MOVING, camera_of(), None, PhotoSettings(), time_s=0.3,
        outputs=("rgb", "alpha", "depth", "median_depth", "distance", "time_s"),
    )  # fmt: skip
    drawn = render(MOVING, camera_of(), 0.3, outputs=("rgb", "alpha", "depth", "median_depth"))
    for name in ("rgb", "alpha", "depth", "median_depth"):
        assert torch.equal(getattr(made, name), getattr(drawn, name)), name
    assert made.backend == "raster"
    assert made.skipped_effects == ("rays: no effect of the camera shows, the rasteriser draws",)
    assert bool(made.valid.all())
    assert not made.time_s.any()
    assert bool((made.distance >= made.depth).all())


def test_raster_settings_reach_the_rasteriser() -> None:
    own = RenderSettings(background=(0.1, 0.2, 0.3), dilation_px2=0.0)
    made = shot(CLOUD, camera_of(), None, PhotoSettings(raster=own))
    assert torch.equal(made.rgb, render(CLOUD, camera_of(), settings=own).rgb)


def test_what_was_left_out_is_told_with_the_image() -> None:
    optics = Optics(aperture=Aperture(radius=0.0, focus_distance=1.0), exposure_s=0.01)
    made = shot(scene_of(CLOUD), camera_of(), optics, PhotoSettings(samples=8))
    assert made.skipped_effects == (
        "rays: no effect of the camera shows, the rasteriser draws",
        "aperture: its radius is 0",
        "exposure: neither scene nor camera moves meanwhile",
        "8 samples per pixel: all rays of a pixel are the same",
    )


@pytest.mark.parametrize("subject", [CLOUD, scene_of(CLOUD)], ids=["Gaussians", "scene"])
def test_time_does_not_show_where_nothing_moves(subject) -> None:
    effects = found(subject, BUSY)
    assert not effects.any
    assert effects.samples == 1
    assert effects.skipped_effects == (STILL,)


@pytest.mark.parametrize(
    ("time_s", "moves"), [(-0.1, False), (-0.01, True), (0.5, True), (1.01, True), (1.1, False)]
)
def test_before_and_after_its_motion_a_scene_stands_still(time_s: float, moves: bool) -> None:
    effects = found(MOVING, BUSY, time_s)
    assert effects.scene_moves is effects.rolls is effects.exposes is effects.any is moves
    assert effects.skipped_effects == (() if moves else (STILL,))


def test_an_image_outside_of_the_motion_is_that_of_its_end() -> None:
    late = shot(MOVING, camera_of(), BUSY, SHARP, time_s=7.0, backend="trace")
    end = shot(MOVING.state_at(1.0), camera_of(), None, SHARP, backend="trace")
    assert torch.equal(late.rgb, end.rgb)


def test_a_shutter_without_read_out_is_none() -> None:
    effects = found(MOVING, Optics(shutter=Shutter(readout_s=0.0)))
    assert not effects.any
    assert effects.skipped_effects == ()
    effects = found(MOVING, Optics(shutter=Shutter(readout_s=0.0), exposure_s=0.01))
    assert not effects.rolls
    assert effects.exposes


def test_a_moving_camera_makes_times_show() -> None:
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[1, 0, 3] = 1.0
    track = PoseTrack(times_s=torch.tensor([0.4, 0.6]), world_from_camera=poses)
    effects = found(CLOUD, BUSY, 0.5, track)
    assert not effects.scene_moves
    assert effects.rolls
    assert effects.exposes
    assert not found(CLOUD, BUSY, 0.2, track).any
    assert not found(CLOUD, Optics(), 0.5, track).any


def test_a_camera_of_a_track_without_effects_is_drawn_from_its_place() -> None:
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[1, 0, 3] = 1.0
    track = PoseTrack(times_s=torch.tensor([0.0, 1.0]), world_from_camera=poses)
    made = shot(CLOUD, camera_of(), None, PhotoSettings(), time_s=0.25, track=track)
    pose = torch.eye(4)
    pose[0, 3] = 0.25
    want = render(CLOUD, camera_of().with_pose(pose))
    torch.testing.assert_close(made.rgb, want.rgb, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["radius", "readout", "exposure"])
def test_what_is_learned_is_traced_even_at_zero(name: str) -> None:
    zero = torch.tensor(0.0, requires_grad=True)
    optics = {
        "radius": Optics(aperture=Aperture(radius=zero, focus_distance=1.0)),
        "readout": Optics(shutter=Shutter(readout_s=zero)),
        "exposure": Optics(exposure_s=zero),
    }[name]
    effects = found(MOVING, optics)
    assert effects.any
    assert effects.skipped_effects == ()
    settings = PhotoSettings(samples=None if name == "readout" else 4)
    made = shot(MOVING, camera_of(), optics, settings, time_s=0.5)
    assert made.backend == "trace"
    made.rgb.square().sum().backward()
    assert bool(torch.isfinite(zero.grad))


def test_a_read_out_of_zero_learns_that_lines_differ() -> None:
    zero = torch.tensor(0.0, requires_grad=True)
    made = shot(MOVING, camera_of(), Optics(shutter=Shutter(readout_s=zero)), SHARP, time_s=0.5)
    made.rgb[:15, :33].square().sum().backward()
    assert float(zero.grad) != 0


def test_a_lens_bends_and_samples_are_needless_to_it() -> None:
    effects = found(CLOUD, Optics(lens=OpenCVFisheye(coefficients=torch.zeros(4))), samples=32)
    assert effects.bends
    assert not effects.scatters
    assert effects.samples == 1
    assert effects.skipped_effects == ("32 samples per pixel: all rays of a pixel are the same",)


def test_samples_are_as_many_as_the_effects_need() -> None:
    aperture = Aperture(radius=0.1, focus_distance=1.0)
    assert found(MOVING, Optics(aperture=aperture, exposure_s=0.1)).samples == 64
    assert found(MOVING, Optics(exposure_s=0.1)).samples == 16
    assert found(CLOUD, Optics(), pixel_area=True).samples == 16
    assert found(CLOUD, Optics(aperture=aperture), samples=5).samples == 5
    assert found(MOVING, Optics(shutter=Shutter(readout_s=0.1))).samples == 1


def test_one_key_is_no_motion() -> None:
    scene = keyed(CLOUD, [0.5], torch.ones(1, 2, 3))
    assert not found(scene, BUSY).any
