import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.formats.axes import swap_opengl_opencv
from diff4splat.paths.formats.source import PathSource

VIEW = pinhole(60.0, (48, 64))


def test_the_default_camera_is_one_camera() -> None:
    with pytest.raises(ShapeError, match=r"PathSource\.view: expected one camera"):
        PathSource(name="x", view=VIEW.with_pose(torch.eye(4).expand(2, 4, 4)))


def test_the_frame_rate_is_above_zero() -> None:
    with pytest.raises(InputError, match="fps: expected a finite rate above 0"):
        PathSource(name="x", view=VIEW, fps=0.0)


def test_swapping_twice_changes_nothing() -> None:
    poses = torch.randn(5, 4, 4, dtype=torch.float64)
    assert torch.equal(swap_opengl_opencv(swap_opengl_opencv(poses)), poses)


def test_swapping_turns_the_camera_axes_and_not_the_world() -> None:
    pose = torch.arange(16.0).reshape(4, 4)
    expected = pose @ torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0]))
    assert torch.equal(swap_opengl_opencv(pose), expected)
