"""Cameras as plain numbers, and the directions in which an image is sampled.

A direction is (x, y, 1) in camera axes: x = (u − c_x) / f_x, y = (v − c_y) / f_y.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.geometry.camera import Camera


class RenderCamera(NamedTuple):
    """One camera at one time."""

    rotation: np.ndarray
    """3 × 3: its columns are the camera's axes in the world."""
    position: np.ndarray
    focal: np.ndarray
    center: np.ndarray
    height: int
    width: int


class SampleGrid(NamedTuple):
    """A lattice of samples: n × n per pixel, turned so that no two share a column or row.

    Sample (row, column) has the direction (x[row mod n, column], y[row] + bend[column], 1). Where
    n = 1 samples are pixel centres.
    """

    x: np.ndarray
    y: np.ndarray
    bend: np.ndarray
    focal: np.ndarray
    center: np.ndarray
    per_side: int


def render_camera(camera: Camera, frame: int) -> RenderCamera:
    """One frame of a batch of cameras."""
    pose = camera.world_from_camera[frame].double().numpy()
    return RenderCamera(
        np.ascontiguousarray(pose[:3, :3]),
        np.ascontiguousarray(pose[:3, 3]),
        camera.focal_px[frame].double().numpy(),
        camera.center_px[frame].double().numpy(),
        *camera.size_px,
    )


def sample_grid(lens: RenderCamera, per_side: int) -> SampleGrid:
    """Samples of an image."""
    columns = np.arange(lens.width * per_side, dtype=np.float64)
    rows = np.arange(lens.height * per_side, dtype=np.float64)
    shift = (np.arange(per_side) - (per_side - 1) / 2) / (per_side * per_side)
    x = (columns[None] + 0.5) / per_side + shift[:, None]
    bend = -shift[np.arange(len(columns)) % per_side]
    return SampleGrid(
        (x - lens.center[0]) / lens.focal[0],
        ((rows + 0.5) / per_side - lens.center[1]) / lens.focal[1],
        bend / lens.focal[1],
        lens.focal,
        lens.center,
        per_side,
    )


@kernel
def to_camera(positions, lens, local):
    """World positions into camera axes, sums in a fixed order."""
    turn = lens.rotation
    for index in range(len(positions)):
        x = positions[index, 0] - lens.position[0]
        y = positions[index, 1] - lens.position[1]
        z = positions[index, 2] - lens.position[2]
        for axis in range(3):
            local[index, axis] = turn[0, axis] * x + turn[1, axis] * y + turn[2, axis] * z
