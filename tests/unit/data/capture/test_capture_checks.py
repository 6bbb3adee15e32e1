"""A capture that no scene can be fitted to is refused before anything is allocated."""

from dataclasses import replace

import pytest
import torch
from small_captures import GreyFrames, small_capture

from diff4splat.data.capture.capture import Capture
from diff4splat.data.capture.checks import require_valid_capture
from diff4splat.errors import InputError, ShapeError


@pytest.fixture
def capture() -> Capture:
    return small_capture([0, 0, 1, 1], [0, 1, 0, 1], [0, 0, 1, 1], [0, 0, 1, 1], depth=True)


def with_pose(capture: Capture, change) -> Capture:
    pose = capture.cameras.world_from_camera.clone()
    change(pose)
    return replace(capture, cameras=replace(capture.cameras, world_from_camera=pose))


def test_a_good_capture_passes(capture: Capture) -> None:
    assert require_valid_capture(capture) is capture
    assert (len(capture), capture.time_range_s) == (4, (0.0, 1.0))


@pytest.mark.parametrize(
    "change",
    [
        {"times_s": torch.zeros(3, dtype=torch.float64)},
        {"camera_index": torch.zeros(5, dtype=torch.int64)},
        {"held_out": torch.zeros(1, dtype=torch.bool)},
        {"frames": GreyFrames(3)},
    ],
)
def test_everything_is_there_once_per_frame(capture: Capture, change: dict, as_shipped) -> None:
    with pytest.raises(ShapeError, match="expected one entry per frame everywhere, got cameras"):
        require_valid_capture(replace(capture, **change))


def test_there_are_images(capture: Capture) -> None:
    nothing = replace(
        capture,
        cameras=capture.cameras[:0],
        times_s=capture.times_s[:0],
        camera_index=capture.camera_index[:0],
        held_out=capture.held_out[:0],
        frames=GreyFrames(0),
    )
    with pytest.raises(InputError, match="expected images, got none"):
        require_valid_capture(nothing)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_times_are_finite(capture: Capture, value: float) -> None:
    times_s = torch.tensor([0, 1, value, 1], dtype=torch.float64)
    with pytest.raises(InputError, match="expected a finite time for every frame"):
        require_valid_capture(replace(capture, times_s=times_s))


def test_a_camera_shows_one_image_at_a_time(capture: Capture) -> None:
    times_s = torch.tensor([0, 1, 7, 7], dtype=torch.float64)
    with pytest.raises(InputError, match="got two of camera 1 at 7 s; give every frame its own"):
        require_valid_capture(replace(capture, times_s=times_s))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda pose: pose[2, 0].fill_(float("nan")), "expected finite numbers, got NaN"),
        (
            lambda pose: pose[2, :3, 0].neg_(),
            "expected right-handed rotations .* got determinant -1",
        ),
        (lambda pose: pose[2, :3, :3].mul_(1.1), "expected rotations without scale or shear"),
    ],
)
def test_poses_are_rotations_and_translations(capture: Capture, change, message: str) -> None:
    with pytest.raises(InputError, match=f"small: camera poses: {message}"):
        require_valid_capture(with_pose(capture, change))


@pytest.mark.parametrize("value", [0.0, -3.0, float("nan"), float("inf")])
def test_focal_lengths_are_above_0(capture: Capture, value: float) -> None:
    focal_px = capture.cameras.focal_px.clone()
    focal_px[1, 1] = value
    with pytest.raises(InputError, match="expected focal lengths above 0; repair the cameras"):
        require_valid_capture(replace(capture, cameras=replace(capture.cameras, focal_px=focal_px)))


def test_one_place_is_enough_with_depth_alone() -> None:
    angles, times_s = [0, 0, 0], [0, 1, 2]
    require_valid_capture(small_capture(angles, times_s, [0, 0, 1], [0, 0, 0], depth=True))
    with pytest.raises(InputError, match="got one static camera and no depth; move the camera"):
        require_valid_capture(small_capture(angles, times_s, [0, 0, 1], [0, 0, 0]))


def test_places_that_are_held_out_say_nothing_of_depth() -> None:
    with pytest.raises(InputError, match="images from at least two places"):
        require_valid_capture(small_capture([0, 1], [0, 0], [0, 1]))
    require_valid_capture(small_capture([0, 1], [0, 0], [0, 0]))
