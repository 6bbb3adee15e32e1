"""What every capture that was read must hold, compared with the cameras it was made from."""

from collections.abc import Callable

import numpy as np
import torch
from capture_folders import Seer, point_at

from diff4splat.data.capture.capture import Capture
from diff4splat.geometry.camera import project


def projected(
    capture: Capture, index: int, time: float, where: Callable[[float], np.ndarray] = point_at
) -> tuple[float, float]:
    """Where the capture's own camera puts the bright point."""
    point = torch.from_numpy(where(time))[None]
    return tuple(project(capture.cameras[index], point)[0][0].tolist())


def assert_pose(capture: Capture, index: int, camera: Seer) -> None:
    """The pose is that of ``camera``."""
    pose = capture.cameras.world_from_camera[index].numpy()
    np.testing.assert_allclose(pose[:3, :3], camera.rows().T, atol=1e-9)
    np.testing.assert_allclose(pose[:3, 3], camera.position, atol=1e-9)


def assert_sees(capture: Capture, index: int, camera: Seer, time: float) -> None:
    """The projected point lies in the one red pixel of the image, and where ``camera`` has it."""
    column, row = projected(capture, index, time)
    np.testing.assert_allclose((column, row), camera.straight_px(point_at(time)), atol=1e-6)
    rgb = capture.frames.read(index).rgb
    redness = rgb[..., 0] - rgb[..., 1]
    found = divmod(int(redness.argmax()), rgb.shape[1])
    assert found == (int(np.floor(row)), int(np.floor(column)))
    assert float(redness.max()) > 0.3


def middle_of_light(rgb: torch.Tensor) -> tuple[float, float]:
    """(x, y) of the centre of brightness."""
    light = rgb.sum(-1).double()
    height, width = light.shape
    x, y = torch.arange(width) + 0.5, torch.arange(height) + 0.5
    return float((light.sum(0) * x).sum() / light.sum()), float(
        (light.sum(1) * y).sum() / light.sum()
    )
