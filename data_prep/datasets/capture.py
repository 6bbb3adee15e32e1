"""One's own recordings: any capture that ``fit`` reads, or a video beside a camera path.

Cameras that share their times are views of one clip. A video ``NAME.mp4`` has its poses in
``NAME.json`` or ``NAME.txt`` (``docs/reference/camera-paths.md``). Lengths are the units of the
file, so that ``metric`` is none; the licence is the owner's.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.data_prep.datasets.common.folders import require_equal_counts
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FrameMaps,
    ListedSequence,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole
from diff4splat.io.cameras.path_files import read_path
from diff4splat.io.pixels import to_bytes

_VIDEO_SUFFIXES, _POSE_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm"), (".json", ".txt")
_CACHE_BYTES = 1 << 26


def _sequences(root: Path) -> Iterator[ListedSequence]:
    videos = [(video, file) for video in _videos(root) if (file := _poses_of(video)) is not None]
    for video, file in videos:
        yield ListedSequence(name=video.stem, open=partial(_open_video, video, file))
    if not videos:
        yield ListedSequence(name=root.resolve().stem, open=partial(_open_capture, root))


def _videos(root: Path) -> list[Path]:
    files = [root] if root.is_file() else sorted(root.iterdir())
    return [file for file in files if file.suffix.lower() in _VIDEO_SUFFIXES]


def _poses_of(video: Path) -> Path | None:
    files = (video.with_suffix(suffix) for suffix in _POSE_SUFFIXES)
    return next((file for file in files if file.is_file()), None)


def _open_video(file: Path, pose_file: Path) -> Sequence:
    video = VideoFile(file, 1, LruCache(_CACHE_BYTES))
    lens = pinhole(float(max(video.size_px)), video.size_px, torch.float64)
    path = read_path(pose_file, lens, video.fps)
    require_equal_counts(file, {"frames": video.frames, "poses": len(path)})
    view = SequenceView(
        cameras=path.cameras.resized(video.size_px).to(torch.float64),
        read=lambda index: FrameMaps(rgb=video.read(index)),
    )
    return Sequence(
        scene=file.stem, views=(view,), times_s=path.times_s.double().numpy(), license="unknown"
    )


def _open_capture(root: Path) -> Sequence:
    capture = read_capture(root)
    if capture.optics is not None:
        raise InputError(
            f"{root}: expected pinhole cameras, got lenses or shutters that clips cannot hold; "
            "undistort the images first"
        )
    orders = [_in_time(capture, camera) for camera in capture.camera_index.unique().tolist()]
    times = [capture.times_s[order] for order in orders]
    alike = [
        order
        for order, time in zip(orders, times, strict=True)
        if len(time) == len(times[0]) and bool(torch.allclose(time, times[0]))
    ]
    return Sequence(
        scene=capture.name,
        views=tuple(_view(capture, order) for order in alike),
        times_s=times[0].double().numpy(),
        license=capture.license,
    )


def _in_time(capture: Capture, camera: int) -> Tensor:
    """Frames of one camera by time, each time once."""
    frames = (capture.camera_index == camera).nonzero()[:, 0]
    order = frames[capture.times_s[frames].argsort(stable=True)]
    later = torch.ones(len(order), dtype=torch.bool)
    later[1:] = capture.times_s[order].diff() > 0
    return order[later]


def _view(capture: Capture, order: Tensor) -> SequenceView:
    return SequenceView(
        cameras=capture.cameras[order].to(torch.float64),
        read=lambda index: _read(capture, int(order[index])),
    )


def _read(capture: Capture, index: int) -> FrameMaps:
    frame = capture.frames.read(index)
    depth = None if frame.depth is None else frame.depth.numpy().astype(np.float32)
    return FrameMaps(rgb=np.ascontiguousarray(to_bytes(frame.rgb)), depth=depth)


DATASET = Dataset(
    facts=DatasetFacts(name="capture", title="capture", license="unknown", metric="none"),
    expected_files="a capture that fit reads, or NAME.mp4 beside NAME.json",
    sequences=_sequences,
)
