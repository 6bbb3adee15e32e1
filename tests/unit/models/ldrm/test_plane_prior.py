"""What zero corrections mean: the photograph on a plane, seen sharp from where it was taken."""

from dataclasses import replace

import torch

from diff4splat.generation.color_matching import InputGrid, match_input_view
from diff4splat.generation.input_image import InputImage
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.metrics.image import psnr
from diff4splat.models.config.model import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import activate
from diff4splat.models.ldrm.plane_prior import OPAQUE, PLANE_DEPTH, UNSEEN, plane_base
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene


def smooth_picture(height: int = 32, width: int = 48) -> InputImage:
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    rgb = torch.stack([(x / 3).sin(), (y / 4).cos(), ((x + y) / 5).sin()], -1) * 0.4 + 0.5
    return InputImage(rgb=rgb, camera=pinhole(40.0, (height, width)), focal_source="test")


def two_cameras(picture: InputImage) -> Camera:
    turn = quaternion.to_matrix(
        quaternion.from_axis_angle(torch.tensor([0.0, 1, 0]), torch.tensor(0.1))
    )
    second = rigid.from_parts(turn, torch.tensor([0.3, -0.2, 0.5]))
    return picture.camera.with_pose(torch.stack([torch.eye(4), second]))


def first_view_scene(picture: InputImage) -> Scene:
    cameras = picture.camera.with_pose(torch.eye(4)[None])
    raw = torch.zeros(12, 1, *picture.camera.size_px)
    return Scene(
        gaussians=activate(
            raw, plane_base(picture.rgb, picture.camera, cameras, 1), ActivationConfig()
        ),
        motion=StaticMotion(),
        path=CameraPath(cameras=cameras, times_s=torch.zeros(1)),
        provenance=Provenance(generator="test"),
    )


def whole_grid(picture: InputImage) -> InputGrid:
    return InputGrid(picture=picture, stride=1, cells=torch.arange(picture.rgb[..., 0].numel()))


def test_every_cell_of_every_frame_lies_on_the_plane() -> None:
    picture = smooth_picture()
    base = plane_base(picture.rgb, picture.camera, two_cameras(picture), 1)
    gaussians = activate(torch.zeros(12, 2, 32, 48), base, ActivationConfig())
    torch.testing.assert_close(gaussians.means[:, 2], torch.full((2 * 32 * 48,), PLANE_DEPTH))


def test_the_first_frame_is_the_photograph_and_opaque_and_later_ones_are_unseen() -> None:
    picture = smooth_picture()
    base = plane_base(picture.rgb, picture.camera, two_cameras(picture), 1)
    assert torch.equal(base.rgb[0], picture.rgb)
    assert bool((base.opacity[0] == OPAQUE).all())
    assert bool((base.opacity[1] == UNSEEN).all())


def test_later_frames_carry_the_colour_their_ray_sees() -> None:
    """A picture that shows its own pixel position: the colour must be where the point projects."""
    height, width = 32, 48
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    rgb = torch.stack([x / width, y / height, torch.zeros_like(x)], -1)
    picture = InputImage(rgb=rgb, camera=pinhole(40.0, (height, width)), focal_source="test")
    base = plane_base(picture.rgb, picture.camera, two_cameras(picture), 1)
    gaussians = activate(torch.zeros(12, 2, height, width), base, ActivationConfig())
    points = gaussians.means[height * width :]
    pixels, _ = project(picture.camera, points)
    expected = pixels / torch.tensor([width, height])
    inside = ((expected > 0.05) & (expected < 0.95)).all(-1)
    assert int(inside.sum()) > 500
    actual = base.rgb[1].flatten(0, 1)[:, :2]
    torch.testing.assert_close(actual[inside], expected[inside], atol=1e-4, rtol=0)


def test_rays_that_miss_the_plane_stay_finite() -> None:
    picture = smooth_picture()
    backwards = torch.diag(torch.tensor([-1.0, 1, -1, 1]))
    base = plane_base(
        picture.rgb,
        picture.camera,
        picture.camera.with_pose(torch.stack([torch.eye(4), backwards])),
        1,
    )
    assert bool(torch.isfinite(base.distance).all())
    torch.testing.assert_close(base.distance[1], torch.full((32, 48), PLANE_DEPTH))
    assert bool(torch.isfinite(base.rgb).all())


def test_a_half_grid_averages_two_by_two_pixels() -> None:
    picture = smooth_picture()
    base = plane_base(picture.rgb, picture.camera, two_cameras(picture), 2)
    assert base.rgb.shape == (2, 16, 24, 3)
    torch.testing.assert_close(base.rgb[0, 0, 0], picture.rgb[:2, :2].mean((0, 1)))


def test_matched_colours_sharpen_the_input_view_and_stay_in_range() -> None:
    picture = smooth_picture()
    scene, cells = first_view_scene(picture), torch.arange(32 * 48)
    before = float(psnr(render(scene, picture.camera).rgb, picture.rgb))
    matched = match_input_view(
        scene, InputGrid(picture=picture, stride=1, cells=cells), 3, RunLog()
    )
    after = float(psnr(render(matched, picture.camera).rgb, picture.rgb))
    assert after > before + 5
    assert after > 35
    colors = 0.5 + 0.28209479177387814 * matched.gaussians.sh
    assert float(colors.min()) > -1e-6
    assert float(colors.max()) < 1 + 1e-6
    assert (
        match_input_view(scene, InputGrid(picture=picture, stride=1, cells=cells), 0, RunLog())
        is scene
    )


def test_hard_edges_are_sharpened_without_leaving_the_range_of_colours() -> None:
    edges = torch.rand(32, 48, 3, generator=torch.Generator().manual_seed(0)).round()
    picture = replace(smooth_picture(), rgb=edges)
    matched = match_input_view(first_view_scene(picture), whole_grid(picture), 3, RunLog())
    colors = 0.5 + 0.28209479177387814 * matched.gaussians.sh
    assert float(colors.min()) > -1e-6
    assert float(colors.max()) < 1 + 1e-6


def test_each_gaussian_is_compared_with_its_own_pixel() -> None:
    picture = smooth_picture()
    scene = first_view_scene(picture)
    cells = torch.arange(32 * 48)[100:]
    some = scene.select(torch.arange(32 * 48) >= 100)
    matched = match_input_view(some, InputGrid(picture=picture, stride=1, cells=cells), 3, RunLog())
    seen = render(matched, picture.camera).rgb[8:]
    assert float(psnr(seen, picture.rgb[8:])) > 35


def test_only_the_pixels_of_the_picture_are_matched() -> None:
    picture = smooth_picture()
    scene = first_view_scene(picture)
    elsewhere = torch.arange(32 * 48) + 32 * 48
    assert (
        match_input_view(scene, InputGrid(picture=picture, stride=1, cells=elsewhere), 3, RunLog())
        is scene
    )


def test_gaussians_that_left_their_pixel_keep_their_colour() -> None:
    picture = smooth_picture()
    scene = first_view_scene(picture)
    means = scene.gaussians.means.clone()
    means[:48] += torch.tensor([0.0, 0.4, 0.0])
    moved = replace(scene, gaussians=replace(scene.gaussians, means=means))
    matched = match_input_view(moved, whole_grid(picture), 3, RunLog())
    assert torch.equal(matched.gaussians.sh[:48], scene.gaussians.sh[:48])
    assert not torch.equal(matched.gaussians.sh[48:], scene.gaussians.sh[48:])


def test_a_half_grid_covers_the_picture_and_is_matched_cell_by_cell() -> None:
    picture = smooth_picture()
    cameras = picture.camera.with_pose(torch.eye(4)[None])
    config = ActivationConfig(footprint_px=0.6)
    gaussians = activate(
        torch.zeros(12, 1, 16, 24), plane_base(picture.rgb, picture.camera, cameras, 2), config
    )
    scene = replace(first_view_scene(picture), gaussians=gaussians)
    grid = InputGrid(picture=picture, stride=2, cells=torch.arange(16 * 24))
    alpha = render(scene, picture.camera, outputs=("alpha",)).alpha
    assert float(alpha[2:-2, 2:-2].min()) > 0.97
    before = float(psnr(render(scene, picture.camera).rgb, picture.rgb))
    matched = match_input_view(scene, grid, 3, RunLog())
    assert float(psnr(render(matched, picture.camera).rgb, picture.rgb)) > before + 3
