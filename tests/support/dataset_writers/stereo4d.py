"""Stereo4D: ragged tracks in an archive, the left eye as a video."""

import math
from pathlib import Path

import numpy as np
from toy_scene import Truth

from dataset_writers.images import save_movie

SIZE_PX = (64, 64)
LENS = (32 / math.tan(math.pi / 6), 32 / math.tan(math.pi / 6), 32.0, 32.0)
NAME = "H5xOyNqJkPs_38738739"


def write(truth: Truth, root: Path, video_frames: int | None = None) -> Path:
    folder = root / "train"
    save_movie(truth.left.rgb[:video_frames], folder / f"{NAME}-left_rectified.mp4", 30)
    lengths, indices, coordinates = [], [], []
    for n in range(truth.uv.shape[1]):
        frames = np.flatnonzero(truth.visible[:, n]) if n != 3 else np.array([], int)
        lengths.append(len(frames))
        indices.extend(frames)
        coordinates.extend(truth.positions[frames, n])
    np.savez(
        folder / f"{NAME}.npz",
        name=np.array(NAME),
        timestamps=38738739 + np.arange(truth.frames) * 33333,
        camera2world=truth.left.poses[:, :3].astype(np.float64),
        track_lengths=np.array(lengths),
        track_indices=np.array(indices),
        track_coordinates=np.array(coordinates, np.float64).reshape(-1, 3),
        rectified2rig=np.tile(np.eye(3), (2, 1, 1)),
        fov_bounds=np.array([-30.0, 30, -30, 30]),
    )
    return root
