"""MultiCamVideo: synthetic, ten synchronous cameras per scene, nothing but images and cameras.

Poses are row-vector matrices of Unreal: centimetres, left-handed (x forward, y right, z up). Both
the camera's and the world's axes change; the usual recipe changes the camera's alone and gives
determinant −1. The folder of a scene names the focal length. Source: KwaiVGI/ReCamMaster.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.folders import folders_below, name_below
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FrameMaps,
    ListedSequence,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.readers.files.file_discovery import natural_key
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.errors import FileFormatError

FPS, SENSOR_MM = 15.0, 23.76
_EXTRINSICS = Path("cameras") / "camera_extrinsics.json"
_CV_FROM_UNREAL = np.array([[0.0, 1, 0], [0, 0, -1], [1, 0, 0]])
"""x of OpenCV is y of Unreal, y is −z, and z is x."""
_CACHE_BYTES = 1 << 26


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, lambda path: (path / _EXTRINSICS).is_file()):
        yield ListedSequence(name=name_below(root, folder), open=lambda at=folder: _open(at))


def _open(folder: Path) -> Sequence:
    document = read_object(folder / _EXTRINSICS)
    videos = sorted((folder / "videos").glob("cam*.mp4"), key=lambda f: natural_key(f.name))
    if not videos:
        raise FileFormatError(f"{folder}: expected videos/cam01.mp4, got no video; unpack it")
    frames = _frame_names(document, folder / _EXTRINSICS)
    focal_mm = _focal_mm(folder)
    views = tuple(_view(file, document, frames, focal_mm) for file in videos)
    return Sequence(
        scene="/".join(folder.parts[-2:]),
        views=views,
        times_s=np.arange(len(frames)) / FPS,
    )


def _frame_names(document: dict[str, object], file: Path) -> list[str]:
    """``frame0``, ``frame1`` and so on."""
    names = [f"frame{index}" for index in range(len(document))]
    lacking = next((name for name in names if name not in document), None)
    if lacking is not None or not names:
        raise FileFormatError(f"{file}: expected '{lacking or 'frame0'}', got no such frame")
    return names


def _focal_mm(folder: Path) -> float:
    for part in reversed(folder.resolve().parts):
        match = re.fullmatch(r"f(\d+(?:\.\d+)?)_aperture[\d.]+", part)
        if match:
            return float(match[1])
    raise FileFormatError(
        f"{folder}: expected a folder like f24_aperture5 above, which names the focal length, got "
        "none; keep the folders of the data set"
    )


def _view(
    file: Path, document: dict[str, object], frames: list[str], focal_mm: float
) -> SequenceView:
    video = VideoFile(file, 1, LruCache(_CACHE_BYTES))
    if video.frames != len(frames):
        raise FileFormatError(
            f"{file}: expected {len(frames)} frames like the poses, got {video.frames}; copy it "
            "again"
        )
    rows = np.stack([_matrix(document[name], file, name) for name in frames])
    height, width = video.size_px
    focal_px = focal_mm / SENSOR_MM * width
    intrinsics = np.tile([focal_px, focal_px, width / 2, height / 2], (len(frames), 1))
    world_from_camera = poses.cleaned(_from_unreal(rows), str(file))
    return SequenceView(
        cameras=poses.cameras(world_from_camera, intrinsics, video.size_px),
        read=lambda index: FrameMaps(rgb=video.read(index)),
    )


def _matrix(cameras: object, file: Path, frame: str) -> Float64[np.ndarray, "4 3"]:
    """The rows ``[a b c 0] [d e f 0] [g h i 0] [x y z 1]``; the last column may be absent."""
    text = cameras.get(file.stem) if isinstance(cameras, dict) else None
    rows = re.findall(r"\[([^\]]*)\]", text) if isinstance(text, str) else []
    try:
        found = [[float(number) for number in row.split()] for row in rows]
    except ValueError:
        found = []
    if len(found) != 4 or any(len(row) not in (3, 4) for row in found):
        raise FileFormatError(
            f"{file}: expected four rows of three or four numbers for '{file.stem}' of {frame}, "
            f"got {repr(text)[:60]}"
        )
    return np.array([row[:3] for row in found])


def _from_unreal(rows: Float64[np.ndarray, "t 4 3"]) -> Float64[np.ndarray, "t 4 4"]:
    change = _CV_FROM_UNREAL
    rotation = change @ rows[:, :3].transpose(0, 2, 1) @ change.T
    return poses.from_parts(rotation, rows[:, 3] @ change.T / 100)


DATASET = Dataset(
    facts=DatasetFacts(
        name="multicam_video", title="MultiCamVideo", license="Apache-2.0", metric="exact"
    ),
    expected_files="train/f24_aperture5/scene1/{videos, cameras/camera_extrinsics.json}",
    sequences=_sequences,
)
