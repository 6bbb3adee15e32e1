"""The path as the model sees it: one lens with the photograph, first camera the identity."""

from dataclasses import replace

import pytest
import torch

from diff4splat.generation.inputs.input_cameras import (
    reconcile_intrinsics,
    resample_to_model_frames,
    to_camera_path,
)
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath


def input_image(known: bool) -> InputImage:
    camera = pinhole(40.0, (32, 48))
    return InputImage(
        rgb=torch.rand(32, 48, 3), camera=camera, focal_source="test", focal_known=known
    )


def zooming_path(camera: Camera, focal_px: tuple[float, ...]) -> CameraPath:
    cameras = camera.with_pose(torch.eye(4).expand(len(focal_px), 4, 4))
    focal = torch.tensor(focal_px)[:, None].expand(-1, 2)
    times_s = torch.arange(len(focal_px), dtype=torch.float32)
    return CameraPath(cameras=replace(cameras, focal_px=focal), times_s=times_s)


def test_a_known_lens_stays_and_the_path_keeps_its_zoom() -> None:
    image = input_image(known=True)
    same, path = reconcile_intrinsics(image, zooming_path(image.camera, (80.0, 80.0, 160.0)))
    assert same is image
    torch.testing.assert_close(path.cameras.focal_px[:, 0], torch.tensor([40.0, 40.0, 80.0]))
    torch.testing.assert_close(path.cameras[0].center_px, image.camera.center_px)


def test_a_guessed_lens_gives_way_to_the_one_the_path_names() -> None:
    image = input_image(known=False)
    path = zooming_path(image.camera, (80.0, 160.0))
    changed, same = reconcile_intrinsics(image, path)
    assert same is path
    assert changed.camera.focal_px.tolist() == [80.0, 80.0]
    assert changed.focal_source == "camera path"


@pytest.mark.parametrize("known", [True, False])
def test_agreement_is_left_alone_and_reached_once(known: bool) -> None:
    image = input_image(known)
    path = zooming_path(image.camera, (40.0, 50.0))
    assert reconcile_intrinsics(image, path) == (image, path)
    once = reconcile_intrinsics(image, zooming_path(image.camera, (80.0, 90.0)))
    twice = reconcile_intrinsics(*once)
    assert twice[0] is once[0]
    assert twice[1] is once[1]


def test_cameras_are_brought_to_the_identity_and_the_size_of_the_image() -> None:
    turn = quaternion.to_matrix(torch.randn(4))
    poses = rigid.from_parts(turn, torch.tensor([5.0, 6, 7])).expand(3, 4, 4)
    cameras = pinhole(80.0, (64, 96)).with_pose(poses)
    path = to_camera_path(
        CameraPath(cameras=cameras, times_s=torch.arange(3.0)), pinhole(40.0, (32, 48))
    )
    torch.testing.assert_close(path.cameras.world_from_camera, torch.eye(4).expand(3, 4, 4))
    assert path.cameras.size_px == (32, 48)
    assert path.cameras.focal_px[0].tolist() == [40.0, 40.0]


@pytest.mark.parametrize(("frames", "count"), [(1, 5), (3, 5), (49, 17), (4, 1)])
def test_context_spans_the_time_of_the_path(frames: int, count: int) -> None:
    path = zooming_path(pinhole(40.0, (32, 48)), tuple(40.0 + i for i in range(frames)))
    context = resample_to_model_frames(path, count)
    assert len(context) == count
    if frames > 1 and count > 1:
        torch.testing.assert_close(context.times_s[-1], path.times_s[-1])
        torch.testing.assert_close(context.cameras.focal_px[-1], path.cameras.focal_px[-1])


def test_a_path_on_another_clock_and_in_double_precision_starts_at_zero() -> None:
    path = zooming_path(pinhole(40.0, (32, 48)), (40.0, 40.0, 40.0))
    later = replace(path, times_s=path.times_s + 5).to(torch.float64)
    shown = to_camera_path(later, pinhole(40.0, (32, 48)))
    assert shown.times_s.tolist() == [0.0, 1.0, 2.0]
    assert shown.cameras.focal_px.dtype == torch.float32
