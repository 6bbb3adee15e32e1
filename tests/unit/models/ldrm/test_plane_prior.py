"""Zero corrections mean the image on a plane, and matched colours show it sharp."""

from dataclasses import replace

import torch

from diff4splat.generation.color_matching import InputView, match_input_view
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.types import NO_PIXEL
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


def smooth_image(height: int = 32, width: int = 48) -> InputImage:
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    rgb = torch.stack([(x / 3).sin(), (y / 4).cos(), ((x + y) / 5).sin()], -1) * 0.4 + 0.5
    return InputImage(rgb=rgb, camera=pinhole(40.0, (height, width)), focal_source="test")


def two_cameras(image: InputImage) -> Camera:
    turn = quaternion.to_matrix(
        quaternion.from_axis_angle(torch.tensor([0.0, 1, 0]), torch.tensor(0.1))
    )
    second = rigid.from_parts(turn, torch.tensor([0.3, -0.2, 0.5]))
    return image.camera.with_pose(torch.stack([torch.eye(4), second]))


def first_view_scene(image: InputImage) -> Scene:
    cameras = image.camera.with_pose(torch.eye(4)[None])
    raw = torch.zeros(12, 1, *image.camera.size_px)
    return Scene(
        gaussians=activate(
            raw, plane_base(image.rgb, image.camera, cameras, 1), ActivationConfig()
        ),
        motion=StaticMotion(),
        path=CameraPath(cameras=cameras, times_s=torch.zeros(1)),
        provenance=Provenance(generator="test"),
    )


def input_view(image: InputImage, stride: int = 1) -> InputView:
    """Every Gaussian of the first frame shows its cell."""
    count = image.rgb[..., 0].numel() // stride**2
    return InputView(
        rgb=image.rgb, camera=image.camera, pixel_index=torch.arange(count), stride=stride
    )


def assert_colors_in_range(scene: Scene) -> None:
    colors = 0.5 + 0.28209479177387814 * scene.gaussians.sh
    assert float(colors.min()) > -1e-6
    assert float(colors.max()) < 1 + 1e-6


def test_every_cell_of_every_frame_lies_on_the_plane() -> None:
    image = smooth_image()
    base = plane_base(image.rgb, image.camera, two_cameras(image), 1)
    gaussians = activate(torch.zeros(12, 2, 32, 48), base, ActivationConfig())
    torch.testing.assert_close(gaussians.means[:, 2], torch.full((2 * 32 * 48,), PLANE_DEPTH))


def test_the_first_frame_is_the_image_and_opaque_and_later_ones_are_unseen() -> None:
    image = smooth_image()
    base = plane_base(image.rgb, image.camera, two_cameras(image), 1)
    assert torch.equal(base.rgb[0], image.rgb)
    assert bool((base.opacity[0] == OPAQUE).all())
    assert bool((base.opacity[1] == UNSEEN).all())


def test_later_frames_carry_the_colour_their_ray_sees() -> None:
    """An image that shows its pixel positions: the colour must be where the point projects."""
    height, width = 32, 48
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    rgb = torch.stack([x / width, y / height, torch.zeros_like(x)], -1)
    image = InputImage(rgb=rgb, camera=pinhole(40.0, (height, width)), focal_source="test")
    base = plane_base(image.rgb, image.camera, two_cameras(image), 1)
    gaussians = activate(torch.zeros(12, 2, height, width), base, ActivationConfig())
    points = gaussians.means[height * width :]
    pixels, _ = project(image.camera, points)
    expected = pixels / torch.tensor([width, height])
    inside = ((expected > 0.05) & (expected < 0.95)).all(-1)
    assert int(inside.sum()) > 500
    actual = base.rgb[1].flatten(0, 1)[:, :2]
    torch.testing.assert_close(actual[inside], expected[inside], atol=1e-4, rtol=0)


def test_rays_that_miss_the_plane_stay_finite() -> None:
    image = smooth_image()
    backwards = torch.diag(torch.tensor([-1.0, 1, -1, 1]))
    base = plane_base(
        image.rgb,
        image.camera,
        image.camera.with_pose(torch.stack([torch.eye(4), backwards])),
        1,
    )
    assert bool(torch.isfinite(base.distance).all())
    torch.testing.assert_close(base.distance[1], torch.full((32, 48), PLANE_DEPTH))
    assert bool(torch.isfinite(base.rgb).all())


def test_a_half_grid_averages_two_by_two_pixels() -> None:
    image = smooth_image()
    base = plane_base(image.rgb, image.camera, two_cameras(image), 2)
    assert base.rgb.shape == (2, 16, 24, 3)
    torch.testing.assert_close(base.rgb[0, 0, 0], image.rgb[:2, :2].mean((0, 1)))


def test_matched_colours_sharpen_the_input_view_and_stay_in_range() -> None:
    image = smooth_image()
    scene, view = first_view_scene(image), input_view(image)
    before = float(psnr(render(scene, image.camera).rgb, image.rgb))
    matched = match_input_view(scene, view, 3, RunLog())
    after = float(psnr(render(matched, image.camera).rgb, image.rgb))
    assert after > before + 5
    assert after > 35
    assert_colors_in_range(matched)
    assert match_input_view(scene, view, 0, RunLog()) is scene


def test_hard_edges_are_sharpened_without_leaving_the_range_of_colours() -> None:
    edges = torch.rand(32, 48, 3, generator=torch.Generator().manual_seed(0)).round()
    image = replace(smooth_image(), rgb=edges)
    assert_colors_in_range(
        match_input_view(first_view_scene(image), input_view(image), 3, RunLog())
    )


def test_each_gaussian_is_compared_with_its_pixel() -> None:
    image = smooth_image()
    some = first_view_scene(image).select(torch.arange(32 * 48) >= 100)
    view = replace(input_view(image), pixel_index=torch.arange(32 * 48)[100:])
    rendered = render(match_input_view(some, view, 3, RunLog()), image.camera).rgb[8:]
    assert float(psnr(rendered, image.rgb[8:])) > 35


def test_gaussians_without_a_pixel_keep_their_colour() -> None:
    image = smooth_image()
    scene, index = first_view_scene(image), torch.arange(32 * 48)
    none = replace(input_view(image), pixel_index=torch.full_like(index, NO_PIXEL))
    assert match_input_view(scene, none, 3, RunLog()) is scene
    index[:48] = NO_PIXEL
    matched = match_input_view(scene, replace(none, pixel_index=index), 3, RunLog())
    assert torch.equal(matched.gaussians.sh[:48], scene.gaussians.sh[:48])
    assert not torch.equal(matched.gaussians.sh[48:], scene.gaussians.sh[48:])


def test_a_half_grid_covers_the_image_and_is_matched_cell_by_cell() -> None:
    image = smooth_image()
    cameras = image.camera.with_pose(torch.eye(4)[None])
    config = ActivationConfig(footprint_px=0.6)
    gaussians = activate(
        torch.zeros(12, 1, 16, 24), plane_base(image.rgb, image.camera, cameras, 2), config
    )
    scene = replace(first_view_scene(image), gaussians=gaussians)
    alpha = render(scene, image.camera, outputs=("alpha",)).alpha
    assert float(alpha[2:-2, 2:-2].min()) > 0.97
    before = float(psnr(render(scene, image.camera).rgb, image.rgb))
    matched = match_input_view(scene, input_view(image, 2), 3, RunLog())
    assert float(psnr(render(matched, image.camera).rgb, image.rgb)) > before + 3
