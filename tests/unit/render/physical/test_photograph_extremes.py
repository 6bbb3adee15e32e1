"""Empty, huge, tiny and far: finite images and finite gradients under every effect."""

import math
from dataclasses import replace

import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, drifting, keyed, scene_of, shot
from oracles_trace import brute_force

from diff4splat.geometry.lenses.build import equirectangular_camera, fisheye_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.physical.settings import OUTPUTS, PhotoSettings
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

BACKGROUND = (0.1, 0.2, 0.9)
SETTINGS = PhotoSettings(samples=4, trace=TraceSettings(background=BACKGROUND))
FISHEYE = OpenCVFisheye(coefficients=torch.zeros(4))
EFFECTS = {
    "none": Optics(),
    "lens": Optics(lens=FISHEYE),
    "sphere": Optics(lens=Equirectangular()),
    "aperture": Optics(aperture=Aperture(radius=0.2, focus_distance=2.0)),
    "shutter": Optics(shutter=Shutter(readout_s=0.1)),
    "exposure": Optics(exposure_s=0.1),
    "all": Optics(
        lens=FISHEYE,
        aperture=Aperture(radius=0.2, focus_distance=2.0, surface="sphere"),
        shutter=Shutter(readout_s=0.1, direction="right-to-left"),
        exposure_s=0.1,
    ),
}


def poses() -> PoseTrack:
    """Something moves in any case."""
    own = torch.eye(4).repeat(2, 1, 1)
    own[1, 0, 3] = 0.3
    return PoseTrack(times_s=torch.tensor([-1.0, 1.0]), world_from_camera=own)


def moving(cloud: Gaussians, kind: str) -> Scene:
    if kind == "still":
        return scene_of(cloud)
    if kind == "native":
        return drifting(cloud, (1.0, 0.0, 0.5), deviation_s=0.2)
    offsets = torch.tensor([0.0, 0.2, -0.1])[:, None, None].expand(3, len(cloud), 3)
    return keyed(cloud, [-0.1, 0.01, 0.1], offsets, interpolation="cubic")


@pytest.mark.parametrize("kind", ["still", "native", "key frames"])
@pytest.mark.parametrize("name", EFFECTS)
def test_an_empty_scene_is_its_background(name: str, kind: str) -> None:
    made = shot(
        moving(dots([]), kind), camera_of((5, 6), 4.0), EFFECTS[name], SETTINGS, track=poses(),
        outputs=OUTPUTS, backend="trace",
    )  # fmt: skip
    seen = torch.where(made.valid[..., None], torch.tensor(BACKGROUND), torch.zeros(3))
    torch.testing.assert_close(made.rgb, seen, rtol=0, atol=1e-6)
    for other in ("alpha", "depth", "median_depth", "distance"):
        assert not getattr(made, other).any(), other
    assert made.intervals >= 1


@pytest.mark.parametrize("kind", ["still", "native", "key frames"])
@pytest.mark.parametrize("name", ["lens", "sphere", "aperture", "shutter", "all"])
def test_extreme_gaussians_have_finite_images_and_gradients(name: str, kind: str) -> None:
    means = [
        (0, 0, 0),
        (0, 0, 1e-3),
        (0.1, 0, 0.3),
        (0, 0, 1e6),
        (1e15, 0, 0),
        (0, 0, -3),
        (0, 1, 3),
    ]
    cloud = dots(means, 0.5)
    scales = cloud.scales.clone()
    scales[0], scales[2], scales[3], scales[6] = 3.0, 0.0, 1e5, 1e-9
    quats = cloud.quats.clone()
    quats[1] = 0.0
    leaves = {"means": cloud.means, "scales": scales, "quats": quats, "opacities": cloud.opacities}
    leaves = {key: value.clone().requires_grad_() for key, value in leaves.items()}
    scene = moving(replace(cloud, **leaves), kind)
    camera = camera_of((5, 6), 4.0) if name != "sphere" else equirectangular_camera((5, 6))
    made = shot(scene, camera, EFFECTS[name], SETTINGS, track=poses(), outputs=OUTPUTS)
    total = torch.zeros(())
    for output in OUTPUTS:
        value = getattr(made, output)
        assert bool(torch.isfinite(value).all()), output
        total = total + value.sum() if output in ("rgb", "alpha") else total
    assert float(made.alpha.detach().max()) > 0.5
    total.backward()
    for key, leaf in leaves.items():
        assert bool(torch.isfinite(leaf.grad).all()), key


def test_a_camera_inside_of_a_gaussian_looks_out_of_it() -> None:
    for place in ((0, 0, 0), (0, 0, 0.2), (0, 0, -0.2)):
        cloud = dots([place, (0, 0, 8)], 1.0, 0.5)
        for optics in EFFECTS.values():
            made = shot(drifting(cloud, (0.3, 0, 0)), camera_of((9, 9)), optics, SETTINGS)
            assert bool(torch.isfinite(made.rgb).all())
            assert float(made.alpha[4, 4]) > 0.4


def test_a_wide_aperture_among_gaussians_is_finite() -> None:
    optics = Optics(aperture=Aperture(radius=50.0, focus_distance=1e-3))
    made = shot(
        dots([(0, 0, 1e-3), (3, 0, 0), (0, 0, 5)], 0.5), camera_of((9, 9)), optics, SETTINGS
    )
    assert bool(torch.isfinite(made.rgb).all())


def test_a_focus_at_the_end_of_the_world_is_parallel_rays() -> None:
    far, camera = dots([(0, 0, 4)], 0.1), camera_of((21, 21))
    made = [
        shot(far, camera, Optics(aperture=Aperture(radius=0.1, focus_distance=d)), SETTINGS).rgb
        for d in (1e7, 1e12)
    ]
    torch.testing.assert_close(made[0], made[1], rtol=0, atol=1e-3)


def test_a_read_out_of_years_is_finite() -> None:
    scene = drifting(dots([(0, 0, 4)], 0.1), (1.0, 0, 0))
    for optics in (Optics(shutter=Shutter(readout_s=1e9)), Optics(exposure_s=1e9)):
        made = shot(scene, camera_of((9, 9)), optics, SETTINGS, outputs=("rgb", "time_s"))
        assert bool(torch.isfinite(made.rgb).all() and torch.isfinite(made.time_s).all())


def test_an_exposure_beyond_the_motion_sees_its_ends_standing() -> None:
    # A second of motion within three of exposure: a third before, a third after.
    scene = drifting(dots([(0, 0, 4)], 0.02), (0.4, 0, 0), time_range_s=(0.0, 1.0))
    settings = replace(SHARP, samples=256)
    made = shot(scene, camera_of((9, 41)), Optics(exposure_s=3.0), settings, time_s=0.5).alpha
    ends = [
        shot(scene.state_at(at), camera_of((9, 41)), None, SHARP, backend="trace").alpha
        for at in (0.0, 1.0)
    ]
    for end in ends:
        place = divmod(int(end.argmax()), 41)
        assert float(made[place]) == pytest.approx(float(end[place]) / 3, rel=0.15)


def test_key_frames_stand_before_the_first_and_after_the_last_in_chunks_too() -> None:
    offsets = torch.tensor([[[0.0, 0, 0]], [[0.4, 0, 0]]])
    scene = keyed(dots([(-0.2, 0, 4)], 0.1), [0.0, 0.02], offsets)
    scene = replace(
        scene, gaussians=replace(scene.gaussians, scales=torch.tensor([[0.06, 1e3, 0.06]]))
    )
    optics = Optics(shutter=Shutter(readout_s=0.2))
    settings = replace(SHARP, rows_per_chunk=1)
    made = shot(scene, camera_of((21, 41)), optics, settings).alpha
    first, last = made[:9], made[14:]
    torch.testing.assert_close(first, first[:1].expand_as(first), rtol=0, atol=2e-2)
    assert int(first[0].argmax()) == 15
    assert int(last[-1].argmax()) == 25


@pytest.mark.parametrize("fov_deg", [120.0, 200.0])
def test_a_large_sphere_under_a_fisheye_is_that_of_the_formula_everywhere(fov_deg: float) -> None:
    # A footprint of seven sigma points is too small here, and shows as blocks.
    lens = OpenCVFisheye(coefficients=torch.tensor([0.02, -0.01, 0.002, 0.0]))
    camera = fisheye_camera(fov_deg, (24, 24), lens)
    ball = dots([(0.8, -0.4, 1.2)], 0.9, opacity=0.95)
    made = shot(ball, camera, Optics(lens=lens), outputs=("alpha", "rgb"))
    rows, columns = torch.meshgrid(torch.arange(24) + 0.5, torch.arange(24) + 0.5, indexing="ij")
    points = (torch.stack([columns, rows], -1) - camera.center_px) / camera.focal_px
    radius = points.norm(dim=-1).double()
    low, high = torch.zeros_like(radius), torch.full_like(radius, math.pi)
    for _ in range(60):
        t = 0.5 * (low + high)
        less = t * (1 + 0.02 * t**2 - 0.01 * t**4 + 0.002 * t**6) < radius
        low, high = torch.where(less, t, low), torch.where(less, high, t)
    flat = points.double() / radius[..., None].clamp_min(1e-12) * t.sin()[..., None]
    rays = Rays(
        origins=torch.zeros(576, 3, dtype=torch.float64),
        directions=torch.cat([flat, t.cos()[..., None]], -1).flatten(0, 1),
    )
    want = brute_force(ball.to(torch.float64), rays, TraceSettings())
    sure = torch.from_numpy(want.unsure == 0) & made.valid.flatten()
    alpha = torch.from_numpy(want.alpha)
    assert float(sure.float().mean()) > 0.7
    assert float(alpha.min()) < 0.05
    assert float(alpha.max()) > 0.6
    got = made.alpha.flatten().double()
    torch.testing.assert_close(got[sure], alpha[sure], rtol=0, atol=1e-5)
