"""VKITTI2 (2.0.3): synthetic driving, two cameras, ten variations of every drive.

Extrinsics are world to camera, OpenCV; rows of both cameras are interleaved. The principal point
counts pixel centres as whole numbers, ours are at +0.5. Depth is in centimetres, 65535 is sky. Flow
is 16-bit PNG: red is x, green is y, blue is 0 where it is unknown. Source: Naver Labs' read-me.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.folders import (
    folders_below,
    name_below,
    numbered_files,
    require_consecutive,
    require_equal_counts,
)
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FlowMap,
    FrameMaps,
    ListedSequence,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.png_file import png_levels
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.data_prep.datasets.files.text_table import number_rows
from diff4splat.errors import FileFormatError

FPS = 10.0
_SKY_CM = 65535
_HALF_PIXEL = (0.0, 0.0, 0.5, 0.5)


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, lambda path: (path / "frames" / "rgb").is_dir()):
        yield ListedSequence(name=name_below(root, folder), open=lambda at=folder: _open(at))


def _open(folder: Path) -> Sequence:
    numbers = [n for n in (0, 1) if (folder / "frames" / "rgb" / f"Camera_{n}").is_dir()]
    if not numbers:
        raise FileFormatError(f"{folder}: expected frames/rgb/Camera_0, got no camera; unpack it")
    views = [_view(folder, number) for number in numbers]
    if len(views) == 2:
        left, right = (view.cameras.world_from_camera.numpy() for view in views)
        require_equal_counts(folder, {"images of Camera_0": len(left), "Camera_1": len(right)})
        poses.require_right_of(left, right, str(folder))
    return Sequence(
        scene=folder.parent.name,
        views=tuple(views),
        times_s=np.arange(len(views[0].cameras)) / FPS,
    )


def _view(folder: Path, camera: int) -> SequenceView:
    frames, place = folder / "frames", f"Camera_{camera}"
    images = require_consecutive(numbered_files(frames / "rgb" / place, r"rgb_(\d+)\.jpg"), 0)
    size_px = read_rgb(images[0]).shape[:2]
    count = len(images)
    intrinsics = _rows(folder / "intrinsic.txt", 6, camera, count)[:, 2:] + _HALF_PIXEL
    extrinsics = _rows(folder / "extrinsic.txt", 18, camera, count)[:, 2:].reshape(-1, 4, 4)
    world_from_camera = poses.inverted(poses.cleaned(extrinsics, str(folder / "extrinsic.txt")))

    def read(index: int) -> FrameMaps:
        rgb = read_rgb(images[index])
        require_size(images[index], rgb.shape, size_px)
        file = frames / "depth" / place / f"depth_{index:05d}.png"
        levels = png_levels(file, 16, 1)
        require_size(file, levels.shape, size_px)
        sky = levels == _SKY_CM
        return FrameMaps(
            rgb=rgb,
            depth=np.where(sky, 0, levels).astype(np.float32) / np.float32(100),
            sky=sky,
            to_next=_flow(frames, place, ("forwardFlow", "flow"), index, count - 1),
            to_previous=_flow(frames, place, ("backwardFlow", "backwardFlow"), index, count),
        )

    return SequenceView(
        cameras=poses.cameras(world_from_camera, intrinsics, size_px),
        read=read,
    )


def _rows(file: Path, columns: int, camera: int, frames: int) -> Float64[np.ndarray, "t c"]:
    """The rows of one camera, one per frame in order."""
    rows = number_rows(file, columns, header=1)
    mine = rows[rows[:, 1] == camera]
    if not np.array_equal(mine[:, 0], np.arange(frames)):
        raise FileFormatError(
            f"{file}: expected one row of camera {camera} for each of {frames} frames in order, "
            f"got {len(mine)}; copy it again"
        )
    return mine


def _flow(frames: Path, place: str, names: tuple[str, str], index: int, end: int) -> FlowMap | None:
    """Forward flow ends before the last frame, backward flow begins after the first."""
    folder, stem = names
    first = 0 if folder == "forwardFlow" else 1
    if not (frames / folder).is_dir() or not first <= index < end:
        return None
    levels = png_levels(frames / folder / place / f"{stem}_{index:05d}.png", 16, 3)
    span = np.array(levels.shape[1::-1]) - 1
    offset_px = (2 * levels[..., :2].astype(np.float64) / 65535 - 1) * span
    return FlowMap(offset_px=offset_px.astype(np.float32), known=levels[..., 2] > 0)


DATASET = Dataset(
    facts=DatasetFacts(
        name="vkitti2", title="VKITTI 2.0.3", license="CC-BY-NC-SA-3.0", metric="exact"
    ),
    expected_files="Scene01/clone/{frames/rgb/Camera_0, extrinsic.txt, intrinsic.txt}",
    sequences=_sequences,
)
