"""Captures made of numbers alone, for what asks nothing of images."""

from collections.abc import Sequence

import numpy as np
import torch
from capture_folders import seer

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.geometry.camera import Camera


class GreyFrames:
    """Grey images, with depth where asked for."""

    def __init__(self, count: int, depth: bool = False) -> None:
        self._count, self._depth = count, depth

    def __len__(self) -> int:
        return self._count

    def read(self, index: int) -> Frame:
        depth = torch.ones(4, 6) if self._depth else None
        return Frame(rgb=torch.full((4, 6, 3), 0.5), depth=depth)


def poses_at(angles: Sequence[float]) -> torch.Tensor:
    """Right-handed poses on a circle."""
    rows = []
    for angle in angles:
        camera = seer(angle)
        columns = np.stack([camera.right, camera.down, camera.forward, camera.position], 1)
        rows.append(np.concatenate([columns, [[0, 0, 0, 1]]]))
    return torch.tensor(np.array(rows))


def small_capture(
    angles: Sequence[float],
    times_s: Sequence[float],
    held_out: Sequence[bool],
    cameras: Sequence[int] | None = None,
    depth: bool = False,
) -> Capture:
    """One frame per angle on the circle."""
    count = len(angles)
    return Capture(
        name="small",
        source="test",
        cameras=Camera(
            focal_px=torch.full((count, 2), 5.0, dtype=torch.float64),
            center_px=torch.tensor([[3.0, 2.0]], dtype=torch.float64).expand(count, 2),
            world_from_camera=poses_at(angles),
            size_px=(4, 6),
        ),
        times_s=torch.tensor(times_s, dtype=torch.float64),
        camera_index=torch.tensor(range(count) if cameras is None else cameras),
        held_out=torch.tensor(held_out).bool(),
        frames=GreyFrames(count, depth),
    )
