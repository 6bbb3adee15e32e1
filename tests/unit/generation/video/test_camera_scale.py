"""The unit of cameras: found from the video, whatever it is; known to be unknown otherwise."""

import math
from dataclasses import replace
from itertools import product

import pytest
import torch
from plane_videos import DEPTH, SIZE, plane_video
from torch import Tensor

from diff4splat.generation.inputs.input_video import InputVideo
from diff4splat.generation.video.camera_scale import (
    FINE,
    CameraScale,
    find_camera_scale,
    scaled,
)
from diff4splat.geometry import quaternion
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.camera_path import CameraPath

STEP = 0.08


class ConstantDistance(torch.nn.Module):
    """A depth prior that says one raw distance everywhere."""

    def __init__(self, raw: float) -> None:
        super().__init__()
        self.raw = torch.nn.Parameter(torch.tensor(raw))

    def forward(self, image: Tensor) -> Tensor:
        return self.raw.expand_as(image[:, :1])

    def predict_distance_and_uncertainty(self, image: Tensor) -> tuple[Tensor, None]:
        return self(image), None


def model_that_sees(depth: float) -> Model:
    """Whose depth prior says that everything is at ``depth``, in model units."""
    model = Model(config=size_by_name("small"))
    prior = ConstantDistance(math.log(depth / PLANE_DEPTH))
    return replace(model, networks=replace(model.networks, monocular_depth=prior))


def video(unit: float = 1.0, step: float = STEP) -> InputVideo:
    """A plane at DEPTH · unit, seen by cameras that start anywhere and are turned."""
    posed = plane_video(step)
    cameras = posed.cameras[0].to(torch.float64)
    poses = cameras.world_from_camera.clone()
    poses[:, :3, 3] *= unit
    turned = torch.eye(4, dtype=torch.float64)
    turned[:3, :3] = quaternion.to_matrix(torch.tensor([0.9, 0.1, -0.3, 0.2]).double())
    turned[:3, 3] = torch.tensor([3.0, -1.0, 2.0]) * unit
    path = CameraPath(cameras=cameras.with_pose(turned @ poses), times_s=torch.arange(9.0).double())
    return InputVideo(
        rgb=posed.rgb[0].movedim(0, -1),
        path=path,
        index=torch.arange(9),
        other_index=torch.arange(0),
        full_path=path,
    )


QUICK = {(1e-4, 3.0), (250.0, 3.22), (1.0, 5.0), (0.3, 5.0)}
UNITS_AND_DEPTHS = [
    pair if pair in QUICK else pytest.param(*pair, marks=pytest.mark.slow)
    for pair in product((1e-4, 0.3, 1.0, 250.0), (3.0, 3.22, 5.0))
]


@pytest.mark.parametrize(("unit", "depth"), UNITS_AND_DEPTHS)
def test_the_unit_is_found_whatever_it_is(unit: float, depth: float) -> None:
    """The plane lies at DEPTH · unit in the capture and at ``depth`` for the prior."""
    scale = find_camera_scale(model_that_sees(depth), video(unit))
    assert scale.observable
    assert math.log(scale.factor * DEPTH * unit / depth) == pytest.approx(0, abs=2 * FINE)
    assert scale.median_depth == pytest.approx(PLANE_DEPTH / scale.factor)


def test_a_camera_that_does_not_move_shows_no_unit() -> None:
    assert find_camera_scale(model_that_sees(4.0), video(step=0.0)) == CameraScale(
        factor=1.0, observable=False
    )


def test_images_without_texture_show_no_unit() -> None:
    bare = replace(video(), rgb=torch.full((9, *SIZE, 3), 0.5))
    scale = find_camera_scale(model_that_sees(4.0), bare)
    assert not scale.observable and math.isfinite(scale.factor) and scale.factor > 0


def test_a_model_without_a_depth_prior_knows_no_unit() -> None:
    """Cameras then stay nearer to the first than the median depth."""
    model = Model(config=size_by_name("test"))
    assert find_camera_scale(model, video()) == CameraScale(factor=1.0, observable=False)
    far = find_camera_scale(model, video(1e4))
    assert not far.observable
    assert far.factor == pytest.approx(PLANE_DEPTH / (8 * STEP * 1e4))


def test_scaled_cameras_count_from_the_first() -> None:
    cameras = video(2.0).path.cameras
    found = scaled(cameras, 0.5)
    torch.testing.assert_close(
        found.world_from_camera[0], torch.eye(4, dtype=torch.float64), atol=1e-12, rtol=0
    )
    expected = [STEP * index for index in range(9)]
    torch.testing.assert_close(found.position[:, 0], torch.tensor(expected).double())
