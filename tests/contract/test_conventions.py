"""One test per line of docs/reference/conventions.md, found by the name in brackets."""

import re
from pathlib import Path

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.flow.path import add_noise, velocity
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.canonical_scene import CanonicalScene
from diff4splat.generation.video.deformation_motion import deform
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.geometry.depth import depth_from_distance, distance_from_depth, unproject
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.optics import Optics, Shutter
from diff4splat.geometry.rays import camera_rays, pixel_centers, plucker_map, world_rays
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.deformation.network import DeformationNetwork
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.render.physical.sensor_rows import line_shares
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "conventions.md"
F64 = torch.float64


def ball(
    position: tuple[float, float, float],
    rgb: tuple[float, float, float] = (1, 1, 1),
    sigma: float = 0.05,
) -> Gaussians:
    """One opaque round Gaussian."""
    return Gaussians(
        means=torch.tensor([position]),
        quats=torch.tensor([[1.0, 0, 0, 0]]),
        scales=torch.full((1, 3), sigma),
        opacities=torch.ones(1),
        sh=harmonics.dc_from_color(torch.tensor([[rgb]], dtype=torch.float32)),
    )


def brightest_pixel(image: torch.Tensor) -> tuple[int, int]:
    """(row, column) of the largest value."""
    return divmod(int(image.sum(-1).argmax()), image.shape[1])


def quarter_turn(axis: list[float]) -> torch.Tensor:
    return quaternion.from_axis_angle(torch.tensor(axis), torch.tensor(torch.pi / 2))


def test_every_line_has_a_test() -> None:
    names = re.findall(r"^- \[([a-z-]+)\]", PAGE.read_text(), re.MULTILINE)
    assert len(names) > 10
    missing = [name for name in names if f"test_{name.replace('-', '_')}" not in globals()]
    assert not missing


def test_axes() -> None:
    camera = pinhole(32.0, (32, 32))
    right, below = ball((0.2, 0.0, 1.0)), ball((0.0, 0.2, 1.0))
    assert brightest_pixel(render(right, camera).rgb)[1] > 20
    assert brightest_pixel(render(below, camera).rgb)[0] > 20
    assert float(render(ball((0.0, 0.0, -1.0)), camera).rgb.max()) == 0


def test_poses() -> None:
    pose = rigid.from_parts(
        quaternion.to_matrix(quarter_turn([0.0, 1.0, 0.0])), torch.tensor([1.0, 2, 3])
    )
    camera = pinhole(10.0, (4, 4)).with_pose(pose)
    torch.testing.assert_close(camera.world_from_camera @ camera.camera_from_world, torch.eye(4))
    torch.testing.assert_close(rigid.transform_points(pose, torch.zeros(1, 3))[0], camera.position)


def test_pixel_centers() -> None:
    torch.testing.assert_close(
        pixel_centers((2, 3), torch.zeros(1))[1, 2], torch.tensor([2.5, 1.5])
    )


def test_intrinsics() -> None:
    camera = pinhole(30.0, (20, 40)).resized((40, 80))
    assert camera.focal_px.tolist() == [60.0, 60.0]
    assert camera.center_px.tolist() == [40.0, 20.0]


def test_depth() -> None:
    camera = pinhole(8.0, (6, 8), F64)
    points = unproject(camera, torch.full((6, 8), 2.0, dtype=F64))
    torch.testing.assert_close(points[..., 2], torch.full((6, 8), 2.0, dtype=F64))
    distance = distance_from_depth(camera, points[..., 2])
    torch.testing.assert_close(distance, points.norm(dim=-1))
    torch.testing.assert_close(depth_from_distance(camera, distance), points[..., 2])
    torch.testing.assert_close(
        render(ball((0.3, 0, 2.0)), pinhole(8.0, (8, 8)), outputs=("depth",)).depth.max(),
        torch.tensor(2.0),
    )


def test_lens() -> None:
    camera = pinhole(8.0, (6, 8), F64)
    pixels = pixel_centers(camera.size_px, camera.focal_px)
    directions, exist = Pinhole().directions((pixels - camera.center_px) / camera.focal_px)
    assert exist.all()
    torch.testing.assert_close(directions, world_rays(camera)[1])


def test_pluecker() -> None:
    camera = pinhole(8.0, (6, 8), F64).with_pose(
        rigid.from_parts(torch.eye(3, dtype=F64), torch.tensor([1.0, 2, 3], dtype=F64))
    )
    moment, direction = plucker_map(camera).split(3)
    torch.testing.assert_close(direction.norm(dim=0), torch.ones(6, 8, dtype=F64))
    origins, directions = world_rays(camera)
    torch.testing.assert_close(moment.movedim(0, -1), torch.linalg.cross(origins, directions))


def test_images() -> None:
    image = render(ball((0, 0, 1.0), (1.0, 0.5, 0.0)), pinhole(32.0, (32, 48))).rgb
    assert image.shape == (32, 48, 3)
    assert float(image.min()) >= 0
    assert float(image.max()) <= 1
    center = image[16, 24]
    assert center[0] > center[1] > center[2]


def test_invalid_depth() -> None:
    depth = render(ball((0, 0, 1.0)), pinhole(32.0, (32, 32)), outputs=("depth",)).depth
    assert float(depth[0, 0]) == 0


def test_quaternions() -> None:
    turned = quaternion.rotate(quarter_turn([0.0, 0.0, 1.0]), torch.tensor([1.0, 0, 0]))
    torch.testing.assert_close(turned, torch.tensor([0.0, 1, 0]))
    assert quaternion.normalize(torch.zeros(4)).tolist() == [1, 0, 0, 0]


def test_activated() -> None:
    camera = pinhole(64.0, (64, 64), F64)
    one = ball((0, 0, 1.0), sigma=0.1).to(F64)
    alpha = render(
        Gaussians(
            means=one.means,
            quats=one.quats,
            scales=one.scales,
            opacities=one.opacities * 0.5,
            sh=one.sh,
        ),
        camera,
        outputs=("alpha",),
    ).alpha
    peak = float(alpha[31:33, 31:33].mean())
    assert peak == pytest.approx(0.5, abs=0.01)
    one_sigma_px = 6.4
    edge = float(alpha[31, 32 + round(one_sigma_px)])
    assert edge == pytest.approx(0.5 * float(torch.exp(torch.tensor(-0.5))), abs=0.03)


def test_color() -> None:
    sh = torch.zeros(1, 4, 3, dtype=F64)
    sh[0, 2, 0] = 1.0
    forward = torch.tensor([[0.0, 0, 1]], dtype=F64)
    assert (
        float(harmonics.color(sh, forward)[0, 0]) > 0.5 > float(harmonics.color(sh, -forward)[0, 0])
    )
    torch.testing.assert_close(harmonics.color_from_dc(harmonics.dc_from_color(forward)), forward)


def test_deformation() -> None:
    first, second = quarter_turn([1.0, 0, 0]), quarter_turn([0, 0, 1.0])
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0]),
        moving_index=torch.tensor([0]),
        offsets=torch.tensor([[[1.0, 0, 0]]]),
        rotations=second[None, None],
        log_scale_offsets=torch.log(torch.tensor([[[2.0, 2, 2]]])),
    )
    still = ball((0, 0, 1.0))
    still = Gaussians(
        means=still.means,
        quats=first[None],
        scales=still.scales,
        opacities=still.opacities,
        sh=still.sh,
    )
    moved = motion.state_at(still, 0.0)
    torch.testing.assert_close(moved.means, torch.tensor([[1.0, 0, 1]]))
    torch.testing.assert_close(moved.scales, still.scales * 2)
    torch.testing.assert_close(moved.quats[0], quaternion.multiply(first, second))


def test_native_4d() -> None:
    still = ball((0.0, 0.0, 1.0), (0.5, 0.5, 0.5))
    motion = SpacetimeMotion(
        moving_index=torch.tensor([0]),
        velocities=torch.tensor([[2.0, 0, 0]]),
        time_centers_s=torch.tensor([1.0]),
        time_deviations_s=torch.tensor([0.25]),
        time_range_s=(0.0, 2.0),
        color_waves=torch.ones(1, 1, 1, 3),
        period_s=2.0,
    )
    center = motion.state_at(still, 1.0)
    assert center.means.tolist() == still.means.tolist()
    assert center.opacities.tolist() == [1.0]
    early, late = motion.state_at(still, 0.75), motion.state_at(still, 1.25)
    torch.testing.assert_close(late.means, torch.tensor([[0.5, 0, 1]]))
    torch.testing.assert_close(late.opacities, torch.tensor([-0.5]).exp())
    torch.testing.assert_close(early.sh, late.sh)
    torch.testing.assert_close(early.opacities, late.opacities)
    assert torch.equal(late.scales, still.scales)


def test_frame_time() -> None:
    optics = Optics(shutter=Shutter(readout_s=0.2), exposure_s=0.1)
    assert optics.window_s(3.0) == pytest.approx((2.85, 3.15))
    assert line_shares(3, "top-to-bottom").tolist() == [0.0, 0.5, 1.0]
    assert line_shares(3, "bottom-to-top").tolist() == [1.0, 0.5, 0.0]


def test_level() -> None:
    clean, noise = torch.zeros(1, 2), torch.ones(1, 2)
    assert add_noise(clean, noise, torch.tensor([0.0])).tolist() == [[0, 0]]
    assert add_noise(clean, noise, torch.tensor([1.0])).tolist() == [[1, 1]]
    assert velocity(clean, noise).tolist() == [[1, 1]]


def test_precision() -> None:
    with pytest.raises(ShapeError, match="float32 or float64"):
        render(ball((0, 0, 1.0)).to(torch.float16), pinhole(8.0, (8, 8)))


@pytest.fixture(scope="module")
def generated() -> Scene:
    """An untrained scene of a smooth image along a two-second path."""
    y, x = torch.meshgrid(torch.linspace(0, 6, 32), torch.linspace(0, 6, 32), indexing="ij")
    rgb = torch.stack([x.sin(), y.cos(), (x + y).sin()], -1) * 0.4 + 0.5
    image = InputImage(rgb=rgb, camera=pinhole(30.0, (32, 32)), focal_source="test")
    pipeline = Diff4SplatPipeline.from_pretrained("test")
    return pipeline(image, "right", settings=GenerationSettings(steps=1))


def test_first_camera(generated: Scene) -> None:
    turn = quaternion.to_matrix(quarter_turn([0.0, 1.0, 0.0]))
    elsewhere = rigid.from_parts(turn, torch.tensor([5.0, 6, 7]))
    foreign = generated.path.cameras.world_from_camera[:3] @ elsewhere
    cameras = generated.path.cameras[:3].with_pose(elsewhere @ foreign)
    path = CameraPath(cameras=cameras, times_s=torch.arange(3.0))
    image = InputImage(rgb=torch.rand(32, 32, 3), camera=pinhole(30.0, (32, 32)), focal_source="")
    pipeline = Diff4SplatPipeline.from_pretrained("test")
    scene = pipeline(image, path, settings=GenerationSettings(steps=1))
    torch.testing.assert_close(scene.path.cameras.world_from_camera[0], torch.eye(4))


def test_time(generated: Scene) -> None:
    duration_s = (len(generated.path) - 1) / 24
    assert float(generated.path.times_s[-1]) == pytest.approx(duration_s)
    assert generated.motion.time_range_s == pytest.approx((0.0, duration_s))
    network = DeformationNetwork(size_by_name("test"))
    seen = []
    network.register_forward_pre_hook(lambda _, arguments: seen.append(float(arguments[1])))
    network.heads[0].weight.data.fill_(1e-3)
    canonical = CanonicalScene(
        gaussians=generated.gaussians,
        cell_index=torch.arange(len(generated.gaussians)),
        maps=RawGaussianMaps(
            gaussians=torch.zeros(1, 12, 5, 32, 32), tokens=torch.randn(1, 24, 2, 2, 2)
        ),
    )
    units = DeformationUnits(length_unit=1.0, activation=size_by_name("test").activation)
    motion = deform(network, canonical, torch.tensor([0.0, 1.5, 3.0]), units, RunLog())
    assert motion.time_range_s == (0.0, 3.0)
    assert seen == [0.0, 0.5, 1.0]


def test_zero_is_identity(generated: Scene) -> None:
    assert isinstance(generated.motion, StaticMotion)
    depth = render(generated, generated.path.cameras[0], outputs=("depth",)).depth
    torch.testing.assert_close(depth, torch.full_like(depth, PLANE_DEPTH))
    assert generated.provenance.untrained


def test_projection_undoes_the_rays() -> None:
    camera: Camera = pinhole(7.0, (5, 9), F64)
    pixels, z = project(camera, camera_rays(camera).reshape(-1, 3) * 3)
    torch.testing.assert_close(pixels.reshape(5, 9, 2), pixel_centers((5, 9), pixels))
    torch.testing.assert_close(z, torch.full((45,), 3.0, dtype=F64))
