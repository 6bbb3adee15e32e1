"""Stereo4D: real stereo video, cameras and 3D tracks of the left eye; 63 mm between the eyes.

Tracks are ragged: ``track_lengths`` counts the frames of every track, ``track_indices`` names them,
``track_coordinates`` holds the points. There is no bit for occlusion: a track that has a frame is
seen in it. Depth is that of the tracks, at their pixels alone. Source: Stereo4d/stereo4d-code.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FrameMaps,
    ListedSequence,
    PointTracks,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.npz_file import NpzFile
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.errors import FileFormatError

BASELINE_M, FIELD_OF_VIEW_DEG = 0.063, 60.0
_CACHE_BYTES = 1 << 26
_LARGEST_GAP = 1
"""Frames by which a video may differ from its poses: cutting at a time is inexact."""


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for file in sorted(root.rglob("*.npz")):
        name = file.relative_to(root).with_suffix("").as_posix()
        yield ListedSequence(name=name, open=lambda at=file: _open(at))


def _open(file: Path) -> Sequence:
    facts = NpzFile(file)
    upper = facts.array("camera2world", (None, 3, 4)).astype(np.float64)
    times_us = facts.array("timestamps", (len(upper),)).astype(np.float64)
    videos = {eye: _video(file, eye) for eye in ("left", "right")}
    frames = _common_frames(file, videos, len(upper))
    matrices = np.tile(np.eye(4), (frames, 1, 1))
    matrices[:, :3] = upper[:frames]
    left = poses.cleaned(matrices, str(file))
    points = _points(facts, len(upper), left, _intrinsics(videos["left"].size_px, 1)[0])
    depth_tracks = points if points is not None and points.known.any() else None
    views = [_view(videos["left"], left, depth_tracks)]
    if videos["right"] is not None:
        right = left.copy()
        right[:, :3, 3] += BASELINE_M * left[:, :3, 0]
        views.append(_view(videos["right"], right, None))
    return Sequence(
        scene=file.stem.rsplit("_", 1)[0],
        views=tuple(views),
        times_s=(times_us[:frames] - times_us[0]) / 1e6,
        tracks=None if depth_tracks is None else lambda window: _cut(depth_tracks, window),
    )


def _video(file: Path, eye: str) -> VideoFile | None:
    video = file.with_name(f"{file.stem}-{eye}_rectified.mp4")
    if eye == "right" and not video.is_file():
        return None
    return VideoFile(video, 1, LruCache(_CACHE_BYTES))


def _common_frames(file: Path, videos: dict[str, VideoFile | None], poses_count: int) -> int:
    counts = [video.frames for video in videos.values() if video is not None]
    if max(abs(count - poses_count) for count in counts) > _LARGEST_GAP:
        raise FileFormatError(
            f"{file}: expected videos of {poses_count} frames like the poses, got {counts}; cut "
            "them again by the timestamps"
        )
    return min(poses_count, *counts)


def _intrinsics(size_px: tuple[int, int], count: int) -> Float64[np.ndarray, "t 4"]:
    height, width = size_px
    focal = 0.5 / math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) * width
    return np.tile([focal, focal, width / 2, height / 2], (count, 1))


def _view(
    video: VideoFile, world_from_camera: np.ndarray, points: PointTracks | None
) -> SequenceView:
    cameras = poses.cameras(
        world_from_camera, _intrinsics(video.size_px, len(world_from_camera)), video.size_px
    )
    camera_from_world = poses.inverted(world_from_camera)

    def read(index: int) -> FrameMaps:
        depth = None
        if points is not None:
            depth = _sparse_depth(points, index, camera_from_world[index], video.size_px)
        return FrameMaps(rgb=video.read(index), depth=depth)

    return SequenceView(cameras=cameras, read=read)


def _points(facts: NpzFile, frames: int, left: np.ndarray, lens: np.ndarray) -> PointTracks | None:
    """The ragged tracks as arrays of all frames; frames beyond the videos are left out."""
    lengths = facts.array("track_lengths", (None,)).astype(np.int64)
    indices = facts.array("track_indices", (None,)).astype(np.int64)
    coordinates = facts.array("track_coordinates", (len(indices), 3))
    beyond = len(indices) and (indices.min() < 0 or indices.max() >= frames)
    if lengths.min(initial=0) < 0 or lengths.sum() != len(indices) or beyond:
        raise FileFormatError(
            f"{facts.file}: expected tracks whose lengths add up to {len(indices)} points in "
            f"{frames} frames, got {lengths.sum()}; copy it again"
        )
    positions = np.full((frames, len(lengths), 3), np.nan)
    positions[indices, np.repeat(np.arange(len(lengths)), lengths)] = coordinates
    positions = positions[: len(left), lengths > 0]
    known = np.isfinite(positions).all(-1)
    uv, z = _projected(np.where(known[..., None], positions, 0), poses.inverted(left), lens)
    return PointTracks(positions=positions, known=known, uv=uv, visible=known & (z > 0))


def _projected(
    positions: Float64[np.ndarray, "t n 3"], camera_from_world: np.ndarray, lens: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    local = np.einsum("tij,tnj->tni", camera_from_world[:, :3, :3], positions)
    local += camera_from_world[:, None, :3, 3]
    z = np.where(np.abs(local[..., 2]) > 1e-9, local[..., 2], 1e-9)
    return local[..., :2] / z[..., None] * lens[:2] + lens[2:], local[..., 2]


def _sparse_depth(
    points: PointTracks, index: int, camera_from_world: np.ndarray, size_px: tuple[int, int]
) -> Float32[np.ndarray, "h w"]:
    """The z of the nearest visible point of every pixel; 0 elsewhere."""
    height, width = size_px
    uv = points.uv[index]
    seen = points.visible[index] & ((uv >= 0) & (uv < [width, height])).all(-1)
    z = points.positions[index, seen] @ camera_from_world[2, :3] + camera_from_world[2, 3]
    column, row = uv[seen].astype(int).T
    depth = np.full(size_px, np.inf)
    np.minimum.at(depth, (row, column), z)
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


def _cut(points: PointTracks, window: range) -> PointTracks:
    part = slice(window.start, window.stop)
    return PointTracks(
        positions=points.positions[part],
        known=points.known[part],
        uv=points.uv[part],
        visible=points.visible[part],
    )


DATASET = Dataset(
    facts=DatasetFacts(
        name="stereo4d",
        title="Stereo4D",
        license="CC-BY-4.0",
        metric="pseudo",
        track_source="estimated",
    ),
    expected_files="train/NAME.npz and train/NAME-left_rectified.mp4",
    sequences=_sequences,
)
