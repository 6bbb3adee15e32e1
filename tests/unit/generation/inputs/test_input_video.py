"""Frames of a capture as the networks see them."""

from dataclasses import replace

import pytest
import torch

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.inputs.input_video import (
    VideoChoice,
    choose_video,
    frames_of_camera,
)
from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.optics import Optics

SIZE_PX = (40, 64)


class RampFrames:
    """Red is the column, green the row, blue the frame; of ``SIZE_PX``."""

    def __init__(self, count: int) -> None:
        self._count = count

    def __len__(self) -> int:
        return self._count

    def read(self, index: int) -> Frame:
        rows, columns = (torch.arange(side) / 100 for side in SIZE_PX)
        green, red = torch.meshgrid(rows, columns, indexing="ij")
        return Frame(rgb=torch.stack([red, green, torch.full_like(red, index / 100)], -1))


def capture(times_s: list[float], **changes: object) -> Capture:
    """One camera that moves along x, with a principal point off the centre."""
    count = len(times_s)
    poses = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    poses[:, 0, 3] = torch.arange(count)
    fields = {
        "name": "ramp",
        "source": "test",
        "cameras": Camera(
            focal_px=torch.full((count, 2), 50.0, dtype=torch.float64),
            center_px=torch.tensor([[30.0, 22.0]], dtype=torch.float64).expand(count, 2),
            world_from_camera=poses,
            size_px=SIZE_PX,
        ),
        "times_s": torch.tensor(times_s, dtype=torch.float64),
        "camera_index": torch.zeros(count, dtype=torch.long),
        "held_out": torch.zeros(count, dtype=torch.bool),
        "frames": RampFrames(count),
    }
    return Capture(**fields | changes)


def times(count: int) -> list[float]:
    return [index / 10 for index in range(count)]


@pytest.mark.parametrize(
    ("count", "asked", "expected"),
    [
        (9, 9, list(range(9))),
        (17, 9, list(range(0, 17, 2))),
        (17, 5, list(range(0, 17, 4))),
        (12, 9, [0, 1, 3, 4, 6, 7, 8, 10, 11]),
        (8, 9, [0, 2, 4, 5, 7]),
        (30, 12, [0, 4, 7, 11, 14, 18, 22, 25, 29]),
    ],
)
def test_frames_are_spread_evenly(count: int, asked: int, expected: list[int]) -> None:
    video = choose_video(capture(times(count)), VideoChoice(frames=asked, side_px=32))
    assert video.index.tolist() == expected
    assert sorted([*expected, *video.other_index.tolist()]) == list(range(count))
    assert video.path.times_s.tolist() == [index / 10 for index in expected]
    assert video.path.cameras.position[:, 0].tolist() == expected
    assert len(video.full_path) == count
    blue = video.rgb[..., 2].amax((1, 2)) * 100
    torch.testing.assert_close(blue, torch.tensor(expected).float(), atol=1e-3, rtol=0)


def test_cameras_are_those_of_the_window_that_is_left() -> None:
    """A point's image shows the colour that names the pixel it had before."""
    whole = capture(times(5))
    video = choose_video(whole, VideoChoice(frames=5, side_px=32))
    assert video.rgb.shape[1] % 16 == 0 and video.rgb.shape[2] % 16 == 0
    point = torch.tensor([[0.11, 0.07, 2.0]], dtype=torch.float64)
    before, _ = project(whole.cameras[0], point)
    after, _ = project(video.path.cameras[0], point)
    column, row = (int(value) for value in after[0])
    red, green = (video.rgb[0, row, column, :2] * 100 + 0.5).tolist()
    scale = SIZE_PX[0] / video.rgb.shape[1]
    assert red == pytest.approx(float(before[0, 0]), abs=scale)
    assert green == pytest.approx(float(before[0, 1]), abs=scale)


def test_frames_come_in_order_of_time_and_one_per_time() -> None:
    mixed = capture([0.3, 0.1, 0.2, 0.2, 0.5, 0.4])
    assert frames_of_camera(mixed).tolist() == [1, 2, 0, 5, 4]


def test_held_out_frames_and_other_cameras_are_left_out() -> None:
    several = capture(
        times(8),
        camera_index=torch.tensor([3, 3, 5, 5, 3, 5, 5, 5]),
        held_out=torch.tensor([1, 1, 0, 1, 0, 0, 0, 0]).bool(),
    )
    assert frames_of_camera(several).tolist() == [2, 5, 6, 7]
    assert frames_of_camera(several, 3).tolist() == [4]
    with pytest.raises(InputError, match="--camera: expected one of 3, 5, got 4"):
        frames_of_camera(several, 4)


def test_too_few_frames_are_refused() -> None:
    with pytest.raises(InputError, match=r"at least 5 frames of one camera .* got 4"):
        choose_video(capture(times(4)), VideoChoice())
    none = capture(times(6), held_out=torch.ones(6, dtype=torch.bool))
    with pytest.raises(InputError, match="not held out, got none"):
        choose_video(none, VideoChoice())


def test_lenses_and_broken_cameras_are_refused() -> None:
    with pytest.raises(InputError, match="expected pinhole cameras"):
        choose_video(capture(times(9), optics=Optics()), VideoChoice())
    whole = capture(times(9))
    poses = whole.cameras.world_from_camera.clone()
    poses[4, 0, 0] = torch.nan
    broken = replace(whole, cameras=whole.cameras.with_pose(poses))
    with pytest.raises(InputError, match="cameras of the video"):
        choose_video(broken, VideoChoice())


@pytest.mark.parametrize("side_px", [0, 8, 4096])
def test_sizes_out_of_range_are_refused(side_px: int) -> None:
    with pytest.raises(ConfigError, match="--resolution"):
        choose_video(capture(times(9)), VideoChoice(side_px=side_px))
