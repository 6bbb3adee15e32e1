"""RealEstate10K: static real rooms, cameras of every frame, images by time stamp.

Rows: time in microseconds, fx fy cx cy as shares of width and height, two zeros, and a 3×4 matrix
world to camera, OpenCV. Lengths have an unknown scale per clip. Source: Google's read-me.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FrameMaps,
    ListedSequence,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.data_prep.datasets.files.text_table import numbers
from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.require_file import read_text

_COLUMNS = 19
_NEAREST_US = 20_000
"""An image farther from the time of a pose is another frame, at 30 per second."""


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for file in sorted(root.rglob("*.txt")):
        if _is_camera_file(file):
            name = file.relative_to(root).with_suffix("").as_posix()
            yield ListedSequence(name=name, open=lambda at=file: _open(at))


def _is_camera_file(file: Path) -> bool:
    with file.open("rb") as stream:
        return stream.read(8).startswith(b"http")


def _open(file: Path) -> Sequence:
    rows = _rows(file)
    order = np.argsort(rows[:, 0], kind="stable")
    rows = rows[order]
    if len(rows) < 2:
        raise InputError(f"{file}: expected at least two poses, got {len(rows)}; leave it out")
    if (np.diff(rows[:, 0]) <= 0).any():
        raise FileFormatError(f"{file}: expected different times, got one twice; copy it again")
    images = _images(file, rows[:, 0])
    size_px = read_rgb(images[0]).shape[:2]
    height, width = size_px
    matrices = np.tile(np.eye(4), (len(rows), 1, 1))
    matrices[:, :3] = rows[:, 7:].reshape(-1, 3, 4)
    world_from_camera = poses.inverted(poses.cleaned(matrices, str(file)))
    intrinsics = rows[:, 1:5] * [width, height, width, height]

    def read(index: int) -> FrameMaps:
        rgb = read_rgb(images[index])
        require_size(images[index], rgb.shape, size_px)
        return FrameMaps(rgb=rgb)

    view = SequenceView(cameras=poses.cameras(world_from_camera, intrinsics, size_px), read=read)
    times_s = (rows[:, 0] - rows[0, 0]) / 1e6
    return Sequence(scene=file.stem, views=(view,), times_s=times_s)


def _rows(file: Path) -> np.ndarray:
    lines = read_text(file, "a camera file").splitlines()
    return np.array(
        [
            numbers(line, _COLUMNS, f"{file}, line {place}")
            for place, line in enumerate(lines[1:], 2)
            if line.strip()
        ]
    ).reshape(-1, _COLUMNS)


def _images(file: Path, times_us: np.ndarray) -> list[Path]:
    """The image nearest to each time, in the folder named like the file."""
    folder = file.with_suffix("")
    found = (
        {int(f.stem): f for f in folder.iterdir() if f.stem.isdecimal()} if folder.is_dir() else {}
    )
    if not found:
        raise FileFormatError(
            f"{folder}: expected images named by their time, such as 52553000.png, got none; "
            "extract the frames of the video first"
        )
    stamps = np.array(sorted(found))
    nearest = stamps[np.abs(stamps[None] - times_us[:, None]).argmin(1)]
    late = np.abs(nearest - times_us)
    if late.max() > _NEAREST_US:
        lacking = int(times_us[late.argmax()])
        raise FileFormatError(
            f"{folder}: expected an image for every pose, got none at {lacking} microseconds; "
            "extract it again"
        )
    return [found[int(stamp)] for stamp in nearest]


DATASET = Dataset(
    facts=DatasetFacts(
        name="realestate10k",
        title="RealEstate10K",
        license="CC-BY-4.0",
        metric="none",
        is_static=True,
    ),
    expected_files="train/HASH.txt and train/HASH/TIMESTAMP.png",
    sequences=_sequences,
)
