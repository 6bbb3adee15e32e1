"""What can be asked of `photograph`, what it answers, and what it refuses."""

import math
from dataclasses import replace

import pytest
import torch
from oracles_physical import F64, SHARP, camera_of, dots, drifting, keyed, shot

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.geometry.lenses.build import equirectangular_camera, fisheye_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import OUTPUTS, PhotoSettings
from diff4splat.render.trace.settings import TraceSettings

CLOUD = dots([(0, 0, 4), (0.3, 0.2, 5)], 0.1)
LENS = Optics(aperture=Aperture(radius=0.2, focus_distance=2.0))
BLUE = replace(SHARP, trace=TraceSettings(background=(0.1, 0.2, 0.9)))


def test_only_what_is_asked_for_is_made() -> None:
    for optics in (Optics(), LENS):
        made = shot(CLOUD, camera_of((5, 6)), optics, outputs=("distance", "alpha"))
        there = {name for name in OUTPUTS if getattr(made, name) is not None}
        assert there == {"distance", "alpha"}
        assert made.valid.shape == made.alpha.shape == (5, 6)


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.parametrize("backend", ["trace", "auto"])
def test_every_output_can_be_asked_for_alone(name: str, backend: str) -> None:
    every = shot(CLOUD, camera_of((9, 9)), LENS, outputs=OUTPUTS)
    alone = shot(CLOUD, camera_of((9, 9)), LENS, outputs=(name,))
    assert torch.equal(getattr(alone, name), getattr(every, name))
    plain = shot(CLOUD, camera_of((9, 9)), None, outputs=(name,), backend=backend)
    assert getattr(plain, name).shape[:2] == (9, 9)


@pytest.mark.parametrize("outputs", [("rgb", "flow"), ("normals",), (), "rgb"])
@pytest.mark.usefixtures("as_shipped")
def test_unknown_outputs_are_refused(outputs) -> None:
    with pytest.raises(ConfigError, match="outputs: expected"):
        shot(CLOUD, camera_of(), outputs=outputs)


def test_a_rasteriser_is_refused_where_effects_show() -> None:
    for backend in ("raster", "nothing"):
        with pytest.raises(ConfigError, match="expected 'trace' or 'auto' for a camera with eff"):
            shot(CLOUD, camera_of(), LENS, backend=backend)
    assert shot(CLOUD, camera_of(), None, backend="raster").backend == "raster"
    with pytest.raises(ConfigError, match="backend"):
        shot(CLOUD, camera_of(), None, backend="nothing")


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("samples", 0),
        ("samples", 1 << 20),
        ("smoothing_px2", -1.0),
        ("smoothing_px2", math.nan),
        ("tolerance_px", 0.0),
        ("rows_per_chunk", 0),
        ("most_intervals", 0),
        ("memory_bytes", 5),
    ],
)
def test_bad_settings_are_refused(name: str, bad: float) -> None:
    with pytest.raises(ConfigError, match=rf"PhotoSettings\.{name}: expected"):
        PhotoSettings(**{name: bad})


@pytest.mark.parametrize("backend", ["trace", "auto"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_poses_intrinsics_and_times_must_be_finite(bad: float, backend: str) -> None:
    pose = torch.eye(4)
    pose[0, 3] = bad
    own = camera_of()
    broken = [own.with_pose(pose), replace(own, center_px=torch.tensor([bad, 1.0]))]
    broken.append(replace(own, focal_px=torch.tensor([0.0, 1.0])))
    for camera in broken:
        with pytest.raises(InputError, match="camera: expected finite pose and intrinsics"):
            shot(CLOUD, camera, backend=backend)
    with pytest.raises(InputError, match="time_s: expected a finite number"):
        shot(CLOUD, own, time_s=bad, backend=backend)


@pytest.mark.parametrize("optics", [Optics(), LENS, Optics(exposure_s=0.1)])
def test_a_track_that_is_not_finite_is_refused(optics: Optics) -> None:
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[1, 0, 3] = math.nan
    track = PoseTrack(times_s=torch.tensor([-1.0, 1.0]), world_from_camera=poses)
    with pytest.raises(InputError, match="expected finite"):
        shot(CLOUD, camera_of(), optics, track=track)


def test_half_precision_is_refused() -> None:
    for optics in (Optics(), LENS):
        with pytest.raises(ShapeError, match="float32 or float64"):
            shot(CLOUD.to(torch.float16), camera_of(), optics)


def test_the_dtype_is_that_of_the_gaussians() -> None:
    made = shot(CLOUD.to(F64), camera_of((5, 5)), LENS, replace(SHARP, samples=4), outputs=OUTPUTS)
    for name in OUTPUTS:
        assert getattr(made, name).dtype == F64
    fine = shot(CLOUD, camera_of((5, 5)), LENS, replace(SHARP, samples=4))
    torch.testing.assert_close(made.rgb.float(), fine.rgb, rtol=0, atol=1e-4)


@pytest.mark.parametrize("kind", ["native", "key frames"])
def test_parts_that_fit_into_memory_are_the_same_up_to_rounding(kind: str) -> None:
    scene = drifting(CLOUD, (2.0, 0, 0))
    if kind == "key frames":
        offsets = torch.tensor([0.0, 0.1, -0.1])[:, None, None] * torch.ones(1, 2, 3)
        scene = keyed(CLOUD, [-0.05, 0.0, 0.05], offsets, interpolation="cubic")
    optics = replace(
        LENS, shutter=Shutter(readout_s=0.05, direction="left-to-right"), exposure_s=0.02
    )
    small, large = (
        shot(
            scene, camera_of((33, 41)), optics,
            replace(SHARP, samples=64, memory_bytes=memory), outputs=OUTPUTS,
        )
        for memory in (16 << 20, 1 << 30)
    )  # fmt: skip
    assert 33 * 41 * 64 * 512 > 16 << 20
    # Rays are bundled with others, and float32 is relative to the size of a bundle.
    for name in OUTPUTS:
        torch.testing.assert_close(getattr(small, name), getattr(large, name), rtol=0, atol=5e-6)
    assert torch.equal(small.valid, large.valid)
    assert torch.equal(small.time_s, large.time_s)


def test_more_rays_with_gradients_than_memory_holds_are_refused() -> None:
    radius = torch.tensor(0.2, requires_grad=True)
    optics = Optics(aperture=Aperture(radius=radius, focus_distance=2.0))
    settings = replace(SHARP, samples=64, memory_bytes=16 << 20)
    with pytest.raises(InputError, match="expected at most 32,768 rays with gradients in 16 MiB"):
        shot(CLOUD, camera_of(), optics, settings)
    with torch.no_grad():
        assert bool(torch.isfinite(shot(CLOUD, camera_of(), optics, settings).rgb).all())


def test_nothing_is_seen_outside_of_the_lens() -> None:
    lens = OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=math.radians(110))
    camera = fisheye_camera(220.0, (40, 40), lens)
    made = shot(CLOUD, camera, Optics(lens=lens), BLUE, outputs=OUTPUTS)
    rows, columns = torch.meshgrid(torch.arange(40) - 19.5, torch.arange(40) - 19.5, indexing="ij")
    inside = (rows**2 + columns**2).sqrt() < 20
    assert torch.equal(made.valid, inside)
    for name in OUTPUTS:
        assert not getattr(made, name)[~inside].any(), name
    torch.testing.assert_close(made.rgb[20, 2], torch.tensor([0.1, 0.2, 0.9]))


def test_a_fisheye_sees_behind_itself() -> None:
    # A hundred degrees from the axis.
    angle = math.radians(100)
    behind = dots([(3 * math.sin(angle), 0, 3 * math.cos(angle))], 0.2)
    lens = OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=math.radians(110))
    camera = fisheye_camera(220.0, (41, 41), lens)
    made = shot(behind, camera, Optics(lens=lens), outputs=OUTPUTS)
    column = round(20 + 20.5 * 100 / 110)
    assert float(made.alpha[20, column]) > 0.5
    assert float(made.alpha[:, :30].sum()) == 0.0
    assert float(made.distance[20, column]) == pytest.approx(3.0, rel=0.02)
    assert float(made.depth[20, column]) == float(made.median_depth[20, column]) == 0.0


def test_an_equirectangular_image_shows_everything() -> None:
    camera, optics = equirectangular_camera((16, 32)), Optics(lens=Equirectangular())
    # (row, column) of (longitude, latitude): behind is at the edges, down is the last row.
    places = {(7, 31): (0.3, -0.3, -3), (8, 0): (-0.3, 0.3, -3), (8, 16): (0.3, 0.3, 3)}
    places |= {(8, 24): (3, 0.3, -0.3), (15, 16): (0.03, 3, 0.3), (0, 16): (0.03, -3, 0.3)}
    for (row, column), place in places.items():
        made = shot(dots([place], 0.05), camera, optics, outputs=("alpha", "depth", "distance"))
        assert bool(made.valid.all())
        assert divmod(int(made.alpha.argmax()), 32) == (row, column)
        assert float(made.distance[row, column]) == pytest.approx(math.hypot(*place), rel=0.02)
        want = max(place[2], 0.0)
        assert float(made.depth[row, column]) == pytest.approx(want, rel=0.02, abs=0.02)


def test_what_was_dropped_is_counted_once() -> None:
    means = CLOUD.means.clone()
    means[1, 0] = math.nan
    for optics in (Optics(), LENS):
        made = shot(replace(CLOUD, means=means), camera_of((5, 5)), optics)
        assert made.dropped_nonfinite == 1
        assert bool(torch.isfinite(made.rgb).all())


def test_pixel_areas_are_averaged() -> None:
    tiny = dots([(0, 0, 4)], 0.002)
    middle = shot(tiny, camera_of((3, 3)), None, backend="trace").alpha
    area = shot(tiny, camera_of((3, 3)), None, replace(SHARP, pixel_area=True, samples=4096)).alpha
    # All of a Gaussian lies in the one pixel: 2π σ² o of its square.
    variance = (100 * 0.002 / 4) ** 2
    assert float(middle[1, 1]) > 0.85
    assert float(area[1, 1]) == pytest.approx(0.9 * 2 * math.pi * variance, rel=0.06)
    assert float(area.sum() - area[1, 1]) == 0.0


def test_a_scene_is_widened_as_it_asks_unless_something_else_is_asked_for() -> None:
    scene = replace(drifting(CLOUD, (0, 0, 0)), dilation_px2=0.7)
    own_size = replace(scene.path, cameras=scene.path.cameras.resized((5, 5)))
    scene = replace(scene, path=own_size)
    taken = {
        (told, subject.__class__.__name__): shot(
            subject, camera_of((5, 5)), LENS, PhotoSettings(samples=4, smoothing_px2=told)
        ).rgb
        for told in (None, 0.3, 0.7)
        for subject in (scene, CLOUD)
    }
    assert torch.equal(taken[None, "Scene"], taken[0.7, "Scene"])
    assert torch.equal(taken[None, "Gaussians"], taken[0.3, "Gaussians"])
    assert torch.equal(taken[0.3, "Scene"], taken[0.3, "Gaussians"])
    assert not torch.equal(taken[None, "Scene"], taken[0.3, "Scene"])


def test_bare_gaussians_need_no_scene() -> None:
    own = PhysicalCamera(camera=camera_of((5, 5)), optics=LENS)
    settings = replace(SHARP, samples=4)
    made = photograph(CLOUD, own, settings=settings)
    assert torch.equal(made.rgb, photograph(drifting(CLOUD, (0, 0, 0)), own, settings=settings).rgb)
