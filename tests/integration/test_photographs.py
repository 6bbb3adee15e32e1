"""Real photographs: the first view is the photograph, and the image moves as geometry says.

The image's motion is measured on the rendered frames alone (dense optical flow, OpenCV DIS) and
compared with the motion that the predicted depth and the two poses imply.
"""

import cv2
import numpy as np
import pytest
import torch

from diff4splat.generation.inputs.input_image import InputImage, choose_focal, prepare_image
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

PHOTOGRAPHS = ("astronaut", "coffee", "chelsea")
SIDES_PX = (128, 256)
pytestmark = pytest.mark.photo


def photograph(name: str, side_px: int) -> InputImage:
    data = pytest.importorskip("skimage.data", reason="needs scikit-image's photographs")
    rgb = torch.from_numpy(getattr(data, name)()).float() / 255
    focal = choose_focal((rgb.shape[0], rgb.shape[1]), None, None)
    return prepare_image(rgb, focal, side_px)


def scene_of(image: InputImage, camera: str) -> Scene:
    pipeline = Diff4SplatPipeline.from_pretrained("test")
    return pipeline(image, camera, settings=GenerationSettings(steps=1))


@pytest.mark.parametrize("side_px", SIDES_PX)
@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_the_first_view_reproduces_the_photograph(name: str, side_px: int) -> None:
    image = photograph(name, side_px)
    first = render(scene_of(image, "static"), image.camera).rgb.clamp(0, 1)
    assert float(psnr(first, image.rgb)) >= 28


def grey(rgb: torch.Tensor) -> np.ndarray:
    return (rgb.clamp(0, 1).mean(-1) * 255).byte().numpy()


def textured(rgb: torch.Tensor) -> torch.Tensor:
    """The better textured half of the inner pixels: elsewhere flow cannot be measured."""
    inner = torch.from_numpy(cv2.GaussianBlur(grey(rgb), (0, 0), 1)).float()[16:-16, 16:-16]
    rows, columns = torch.gradient(inner)
    strength = rows**2 + columns**2
    return torch.nn.functional.pad(strength > strength.median(), (16, 16, 16, 16))


def measured_flow(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    solver = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    # Down to single pixels: the coarse default stops at half resolution.
    solver.setFinestScale(0)
    return torch.from_numpy(solver.calc(grey(first), grey(second), None))


@pytest.mark.parametrize("camera", ["left:0.05", "up:0.05", "forward:0.08", "roll:0.008"])
@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_a_small_move_of_the_camera_moves_the_image_as_geometry_says(
    name: str, camera: str
) -> None:
    image = photograph(name, 128)
    scene = scene_of(image, camera)
    start, stop = scene.path.cameras[0], scene.path.cameras[-1]
    first = render(scene, start, outputs=("rgb", "depth"))
    points = unproject(start, first.depth)
    pixels = project(stop, points.flatten(0, 1))[0].unflatten(0, first.depth.shape)
    expected = pixels - pixel_centers(start.size_px, pixels)
    actual = measured_flow(first.rgb, render(scene, stop).rgb)
    seen = textured(first.rgb)
    assert float(expected[seen].norm(dim=-1).mean()) > 1
    assert float((actual - expected)[seen].norm(dim=-1).median()) < 0.25


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_the_rendered_flow_is_the_flow_of_the_rendered_depth(name: str) -> None:
    from diff4splat.render.settings import RenderSettings

    image = photograph(name, 128)
    scene = scene_of(image, "arc:0.1")
    start, stop = scene.path.cameras[0], scene.path.cameras[12]
    settings = RenderSettings(flow_camera=stop)
    first = render(scene, start, outputs=("depth", "flow"), settings=settings)
    points = unproject(start, first.depth).flatten(0, 1)
    pixels = project(stop, points)[0].unflatten(0, first.depth.shape)
    expected = pixels - pixel_centers(start.size_px, pixels)
    error = (first.flow - expected)[2:-2, 2:-2].norm(dim=-1)
    assert float(error.max()) < 0.05 * float(expected.norm(dim=-1).max())
