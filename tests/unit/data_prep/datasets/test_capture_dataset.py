"""One's own recordings become clips: captures with poses, and a video beside a camera path."""

from pathlib import Path

import numpy as np
import pytest
import torch
from dataset_writers.images import save_movie
from oracles_clips import make_clip
from toy_datasets import read_clips

from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import Camera
from diff4splat.io.cameras.path_files import write_path
from diff4splat.paths.camera_path import CameraPath


def filmed(folder: Path, frames: int = 4, poses: int = 4) -> CameraPath:
    rgb = np.random.default_rng(0).integers(0, 255, (frames, 32, 48, 3), np.uint8)
    save_movie(rgb, folder / "holiday.mp4", 10)
    pose = torch.eye(4, dtype=torch.float64).repeat(poses, 1, 1)
    pose[:, 0, 3] = torch.arange(poses) * 0.1
    cameras = Camera(
        focal_px=torch.full((poses, 2), 40.0, dtype=torch.float64),
        center_px=torch.tensor([[24.0, 16.0]], dtype=torch.float64).repeat(poses, 1),
        world_from_camera=pose,
        size_px=(32, 48),
    )
    path = CameraPath(cameras=cameras, times_s=torch.arange(poses).double() / 10)
    write_path(path, folder / "holiday.json", "camera_path_json")
    return path


def test_a_video_beside_its_poses(tmp_path: Path) -> None:
    path = filmed(tmp_path)
    (clip,) = read_clips("capture", tmp_path)
    camera = clip.views[0].cameras
    assert torch.allclose(camera.world_from_camera, path.cameras.world_from_camera, atol=1e-6)
    assert torch.allclose(camera.focal_px, path.cameras.focal_px, atol=1e-4)
    assert clip.fps == pytest.approx(10)
    assert (clip.note.metric, clip.note.license, clip.views[0].depth) == ("none", "unknown", None)
    assert not clip.note.commercial_ok
    assert clip.motion_truth == "unknown"


def test_as_many_poses_as_frames(tmp_path: Path) -> None:
    filmed(tmp_path, poses=3)
    with pytest.raises(FileFormatError, match="expected as many frames as poses, got 4 frames, 3"):
        read_clips("capture", tmp_path)


def test_any_capture_that_fit_reads(tmp_path: Path) -> None:
    clip = make_clip(5, (24, 32), views=2)
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")) as writer:
        writer.write(clip)
    (found,) = read_clips("capture", tmp_path)
    assert (len(found.views), found.frames, found.size_px) == (2, 5, (24, 32))
    assert found.note.license == clip.note.license
    for mine, theirs in zip(found.views, clip.views, strict=True):
        assert torch.equal(mine.rgb, theirs.rgb)
        assert torch.allclose(mine.depth, theirs.depth, rtol=1e-4)
        error = mine.cameras.world_from_camera - theirs.cameras.world_from_camera
        assert error.abs().max() < 1e-9
