"""PointOdyssey (1.2): synthetic, one camera, depth and dense tracks in 2D and 3D.

Extrinsics are world to camera, OpenCV. Depth is uint16, 65535 is 1000 m; arrays may be float16.
Tracks have infinite and missing values; ``info.npz`` holds the shapes of the arrays of
``anno.npz``. Lengths are nominal metres. Source: y-zheng18/point_odyssey.
"""

from collections.abc import Callable, Iterator
from functools import cache
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
    FrameMaps,
    ListedSequence,
    PointTracks,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.npz_file import NpzFile
from diff4splat.data_prep.datasets.files.png_file import png_levels
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.errors import InputError

FPS, FARTHEST_M = 30.0, 1000.0
_FEWEST_TRACKS = 33
"""Fewer are no tracks of the scene, but left over from the export."""
_FIRST_VERSION = ("annot.npz", "annotations.npz")


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, lambda path: (path / "rgbs").is_dir()):
        yield ListedSequence(name=name_below(root, folder), open=lambda at=folder: _open(at))


def _open(folder: Path) -> Sequence:
    for name in _FIRST_VERSION:
        if (folder / name).exists() and not (folder / "anno.npz").exists():
            raise InputError(
                f"{folder}: expected anno.npz of version 1.2, got {name} of an older version, "
                "whose tracks are mirrored; download version 1.2"
            )
    images = require_consecutive(numbered_files(folder / "rgbs", r"rgb_(\d+)\.jpg"), 0)
    facts, size_px = NpzFile(folder / "anno.npz"), read_rgb(images[0]).shape[:2]
    lenses = facts.array("intrinsics", (None, 3, 3)).astype(np.float64)
    extrinsics = facts.array("extrinsics", (None, 4, 4)).astype(np.float64)
    require_equal_counts(
        folder,
        {"images": len(images), "intrinsics": len(lenses), "extrinsics": len(extrinsics)},
    )
    camera_from_world = poses.cleaned(extrinsics, str(facts.file))
    intrinsics = np.stack([lenses[:, 0, 0], lenses[:, 1, 1], lenses[:, 0, 2], lenses[:, 1, 2]], -1)
    view = SequenceView(
        cameras=poses.cameras(poses.inverted(camera_from_world), intrinsics, size_px),
        read=lambda index: _read(folder, images[index], index, size_px),
    )
    return Sequence(
        scene=folder.name,
        views=(view,),
        times_s=np.arange(len(images)) / FPS,
        tracks=_tracks(facts, len(images)) if _has_tracks(folder) else None,
    )


def _read(folder: Path, image: Path, index: int, size_px: tuple[int, int]) -> FrameMaps:
    rgb = read_rgb(image)
    require_size(image, rgb.shape, size_px)
    file = folder / "depths" / f"depth_{index:05d}.png"
    levels = png_levels(file, 16, 1)
    require_size(file, levels.shape, size_px)
    depth = levels.astype(np.float32) * np.float32(FARTHEST_M / 65535)
    return FrameMaps(
        rgb=rgb,
        depth=np.where(depth < FARTHEST_M, depth, np.float32(0)),
        labels=_labels(folder / "masks" / f"mask_{index:05d}.png", size_px),
    )


def _labels(file: Path, size_px: tuple[int, int]) -> np.ndarray | None:
    """A number per colour; black is fog or nothing."""
    if not file.parent.is_dir():
        return None
    colors = read_rgb(file).astype(np.int32)
    require_size(file, colors.shape, size_px)
    return colors @ np.array([65536, 256, 1], np.int32)


def _has_tracks(folder: Path) -> bool:
    """By the shape that ``info.npz`` states; its absence says nothing."""
    if not (folder / "info.npz").is_file():
        return True
    shape = NpzFile(folder / "info.npz").array("trajs_3d", (None,))
    return bool(len(shape) == 3 and shape[1] >= _FEWEST_TRACKS)


def _tracks(facts: NpzFile, frames: int) -> Callable[[range], PointTracks]:
    """Reads the arrays once: an archive cannot be read in parts."""

    @cache
    def arrays() -> tuple[np.ndarray, ...]:
        shape = facts.shape("trajs_3d")[:2]
        return (
            facts.array("trajs_3d", (frames, shape[1], 3)),
            facts.array("trajs_2d", (frames, shape[1], 2)),
            facts.array("visibs", (frames, shape[1])),
            facts.array("valids", (frames, shape[1])),
        )

    def cut(window: range) -> PointTracks:
        positions, uv, visible, valid = (part[window.start : window.stop] for part in arrays())
        known = valid.astype(bool)
        return PointTracks(
            positions=_double(positions),
            known=known,
            uv=_double(uv),
            visible=visible.astype(bool) & known,
        )

    return cut


def _double(values: np.ndarray) -> Float64[np.ndarray, "..."]:
    return values.astype(np.float64)


DATASET = Dataset(
    facts=DatasetFacts(
        name="point_odyssey",
        title="PointOdyssey 1.2",
        license="CC-BY-NC-SA-4.0",
        metric="exact",
    ),
    expected_files="train/SEQUENCE/{rgbs, depths, anno.npz}",
    sequences=_sequences,
)
