"""A plain video to the pose file beside it, which the reader of captures then takes."""

from pathlib import Path

import numpy as np
import torch

from diff4splat.data_prep.alignment.opencv.video_poses import video_poses
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.errors import InputError
from diff4splat.geometry.camera import focal_from_fov, pinhole
from diff4splat.io.cameras.path_files import write_path
from diff4splat.paths.camera_path import CameraPath

MOST_FRAMES = 300
_WORKING_SIDE_PX, _CACHE_BYTES = 640, 1 << 26


def write_video_poses(video: Path, file: Path, fov_deg: float) -> int:
    """Estimate the pose of every frame and write them; returns how many there are.

    Raises:
        FileFormatError: no video that can be decoded.
        InputError: too long, or its camera cannot be followed; says from which frame on.
        OutputError: the file cannot be written.
    """
    source = VideoFile(video, 1, LruCache(_CACHE_BYTES))
    if source.frames > MOST_FRAMES:
        raise InputError(
            f"{video}: expected up to {MOST_FRAMES} frames, got {source.frames}; cut it into clips"
        )
    shrink = max(1, max(source.full_size_px) // _WORKING_SIDE_PX)
    small = VideoFile(video, shrink, LruCache(_CACHE_BYTES))
    rgb = np.stack([small.read(index) for index in range(small.frames)])
    lens = pinhole(focal_from_fov(fov_deg, small.size_px[1]), small.size_px, torch.float64)
    try:
        cameras = video_poses(rgb, lens)
    except InputError as error:
        raise InputError(f"{video}: {error}") from error
    times_s = torch.arange(len(rgb), dtype=torch.float64) / source.fps
    write_path(CameraPath(cameras=cameras.resized(source.full_size_px), times_s=times_s), file)
    return len(rgb)
