"""A scene at other resolutions than its own: the image resampled, without a raster of dots."""

from dataclasses import replace

import pytest
import torch
from filmed_scenes import filmed_scene
from image_layers import random_rgb
from torch.nn.functional import avg_pool2d, interpolate

from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.subpixel_infill import subpixel_infill
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera, pinhole, stack_cameras
from diff4splat.metrics.image import psnr
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render, render_video
from diff4splat.render.resolution import CLOSING_PX2, averaging_factor, scene_dilation_px2
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

SIZE_PX = (32, 48)
RAW = RenderSettings(dilation_px2=0.0)


def slanted_image() -> Scene:
    """A smooth image on a slanted plane, as ``generate`` makes it, without dilation."""
    torch.manual_seed(3)
    small = random_rgb(8, 12).movedim(-1, 0)[None]
    rgb = interpolate(small, SIZE_PX, mode="bicubic", align_corners=False)[0].clamp(0, 1)
    camera = pinhole(45.0, SIZE_PX)
    slope = torch.linspace(1.0, 1.6, SIZE_PX[1]).expand(SIZE_PX)
    image = ImageLayer(
        camera=camera,
        rgb=rgb.movedim(0, -1).contiguous(),
        depth=4.0 / slope,
        mask=torch.ones(SIZE_PX, dtype=torch.bool),
        opacity=0.999,
        footprint_px=PIXEL_FOOTPRINT_PX,
        in_image=True,
    )
    gaussians = concatenate([layer_gaussians(image), layer_gaussians(subpixel_infill(image))])
    return scene_of(gaussians, camera, 0.0)


def scene_of(gaussians: Gaussians, camera: Camera, dilation_px2: float) -> Scene:
    path = CameraPath(cameras=stack_cameras([camera]), times_s=torch.zeros(1))
    return Scene(
        gaussians=gaussians,
        motion=StaticMotion(),
        path=path,
        provenance=Provenance(generator="test"),
        dilation_px2=dilation_px2,
    )


@pytest.fixture(scope="module")
def scene() -> Scene:
    return slanted_image()


def sized(camera: Camera, scale: float) -> Camera:
    return camera.resized(tuple(round(scale * side) for side in camera.size_px))


def moved(camera: Camera) -> Camera:
    """A little aside and nearer: pixels part from each other."""
    pose = camera.world_from_camera.clone()
    pose[:3, 3] += torch.tensor([0.3, 0.1, 0.4])
    return replace(camera, world_from_camera=pose)


def resampled(rgb: torch.Tensor, size_px: tuple[int, int]) -> torch.Tensor:
    shrinks = size_px[0] < rgb.shape[0]
    options = {"mode": "area"} if shrinks else {"mode": "bicubic", "align_corners": False}
    return interpolate(rgb.movedim(-1, 0)[None], size_px, **options)[0].movedim(0, -1).clamp(0, 1)


def inner(rgb: torch.Tensor) -> torch.Tensor:
    """Without the borders, outside which a single layer shows nothing."""
    height, width = (side // 5 for side in rgb.shape[:2])
    return rgb[height:-height, width:-width]


def raster(rgb: torch.Tensor) -> float:
    """Energy of single pixels against their neighbours, where the image itself is smooth."""
    smooth = avg_pool2d(rgb.movedim(-1, 0)[None], 3, 1, 1)[0].movedim(0, -1)
    return float((inner(rgb) - inner(smooth)).square().mean())


@pytest.mark.parametrize("aside", [False, True])
@pytest.mark.parametrize(
    ("scale", "least_db"),
    [(0.25, 60.0), (0.5, 60.0), (0.75, 27.0), (1.5, 29.0), (2.0, 27.0), (4.0, 30.0)],
)
def test_every_size_shows_the_resampled_image(
    scale: float, least_db: float, aside: bool, scene: Scene
) -> None:
    own = moved(scene.path.cameras[0]) if aside else scene.path.cameras[0]
    camera = sized(own, scale)
    want = inner(resampled(render(scene, own).rgb.clamp(0, 1), camera.size_px))
    got, raw = (
        float(psnr(inner(render(scene, camera, settings=settings).rgb.clamp(0, 1)), want))
        for settings in (RenderSettings(), RAW)
    )
    assert got >= least_db
    assert got >= raw - 1.5


def test_no_raster_of_dots_from_near(scene: Scene) -> None:
    camera = sized(moved(scene.path.cameras[0]), 4)
    raw = raster(render(scene, camera, settings=RAW).rgb)
    assert raster(render(scene, camera).rgb) < 0.5 * raw


def test_at_its_own_size_a_scene_is_rendered_to_the_bit_as_before(scene: Scene) -> None:
    for dilation_px2 in (0.0, 0.3):
        subject = replace(scene, dilation_px2=dilation_px2)
        settings = RenderSettings(dilation_px2=dilation_px2)
        for camera in (scene.path.cameras[0], moved(scene.path.cameras[0])):
            zoomed = replace(camera, focal_px=camera.focal_px * 1.7)
            for one in (camera, zoomed):
                outputs = ("rgb", "depth", "alpha")
                got = render(subject, one, outputs=outputs)
                want = render(subject, one, outputs=outputs, settings=settings)
                for name in outputs:
                    assert torch.equal(getattr(got, name), getattr(want, name))


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_videos_and_batches_are_the_images(scale: float) -> None:
    scene = filmed_scene(frames=3, size_px=(12, 16))
    path = replace(scene.path, cameras=sized(scene.path.cameras, scale))
    outputs = ("rgb", "depth", "alpha", "flow", "median_depth")
    frames = list(render_video(scene, path, outputs=outputs))
    assert frames[0].rgb.shape[:2] == path.cameras.size_px
    for index in range(2):
        settings = RenderSettings(
            flow_camera=path.cameras[index + 1], flow_time_s=float(path.times_s[index + 1])
        )
        one = render(
            scene,
            path.cameras[index],
            float(path.times_s[index]),
            outputs=outputs,
            settings=settings,
        )
        for name in outputs:
            torch.testing.assert_close(getattr(frames[index], name), getattr(one, name))
    batch = render(scene, path.cameras, path.times_s)
    torch.testing.assert_close(batch.rgb[1], frames[1].rgb)
    assert next(iter(render_video(scene, path, outputs=("rgb",)))).alpha is None


def test_depth_and_flow_are_averaged_by_what_pixels_cover() -> None:
    scene = filmed_scene(frames=2, size_px=(12, 16))
    camera = sized(scene.path.cameras[0], 0.5)
    pose = camera.world_from_camera.clone()
    pose[0, 3] += 0.5
    settings = RenderSettings(flow_camera=replace(camera, world_from_camera=pose))
    got = render(scene, camera, outputs=("depth", "flow", "alpha"), settings=settings)
    covered = got.alpha > 0.5
    assert covered.any()
    assert bool((got.depth[covered] > 1.5).all())
    assert bool((got.depth[covered] < 4.5).all())
    near = -0.5 * float(camera.focal_px[0]) / got.depth
    torch.testing.assert_close(got.flow[..., 0][covered], near[covered], atol=0.4, rtol=0.2)


def test_what_follows_the_camera(scene: Scene) -> None:
    camera = scene.path.cameras[0]
    fitted = replace(scene, dilation_px2=0.3)
    assert scene_dilation_px2(scene, camera) == 0
    assert scene_dilation_px2(scene, sized(camera, 2)) == pytest.approx(3 * CLOSING_PX2)
    assert scene_dilation_px2(fitted, sized(camera, 2)) == pytest.approx(1.2)
    assert scene_dilation_px2(fitted, sized(camera, 0.5)) == 0.3
    factors = [averaging_factor(scene, sized(camera, scale)) for scale in (4, 1, 0.75, 0.5, 0.25)]
    assert factors == [1, 1, 2, 2, 4]
    window = camera.cropped((4, 4), (16, 16))
    assert averaging_factor(scene, window) == 1
    assert scene_dilation_px2(scene, window) == 0
    wide = replace(sized(camera, 0.5), focal_px=camera.focal_px / 1000)
    assert averaging_factor(scene, wide) <= 4, "no more than twice the scene's own pixels a side"
    empty = scene_of(
        scene.gaussians.select(torch.zeros(len(scene.gaussians), dtype=bool)), camera, 0.0
    )
    assert float(render(empty, sized(camera, 0.25), outputs=("alpha",)).alpha.max()) == 0


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_gradients_pass(scale: float) -> None:
    scene = filmed_scene(frames=1, size_px=(4, 6), side=2).to(torch.float64)
    camera = sized(scene.path.cameras[0], scale)

    def image(means: torch.Tensor, opacities: torch.Tensor) -> torch.Tensor:
        gaussians = replace(scene.gaussians, means=means, opacities=opacities)
        subject = replace(scene, gaussians=gaussians, motion=StaticMotion(), dilation_px2=0.0)
        settings = RenderSettings(alpha_cutoff=1e-12, alpha_max=1 - 1e-12)  # no steps
        found = render(subject, camera, outputs=("rgb",), settings=settings, backend="reference")
        return found.rgb

    inside = scene.gaussians.means * torch.tensor([0.6, 0.3, 1.0])
    inside[:, 2] += torch.linspace(0, 1, len(inside))  # none swaps its place with another
    means = inside.clone().requires_grad_()
    opacities = (0.5 * scene.gaussians.opacities).requires_grad_()
    assert torch.autograd.gradcheck(image, (means, opacities), atol=1e-5)
