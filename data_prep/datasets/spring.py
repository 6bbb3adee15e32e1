"""Spring: animation film, two eyes, disparity and flow on a grid of 4K.

Ground truth has twice the pixels of the images, but its values are pixels of the images: every
second sample is taken, values stay. Extrinsics are world to camera, OpenCV, of the left eye; focal
lengths change over time. Samples of even rows and columns lie a quarter pixel before pixel centres.
Source: cv-stuttgart/flow_library.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
from diff4splat.data_prep.datasets.files.hdf5_file import hdf5_array
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.data_prep.datasets.files.text_table import number_rows
from diff4splat.errors import InputError

BASELINE_M, FPS = 0.065, 24.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Eye:
    """Files of one eye."""

    folder: Path
    name: str
    images: list[Path]
    size_px: tuple[int, int]
    focal_px: np.ndarray

    def file(self, kind: str, index: int, suffix: str) -> Path:
        """The file of a frame; numbers start at 1."""
        name = f"{kind}_{self.name}"
        return self.folder / name / f"{name.rsplit('/', 1)[-1]}_{index + 1:04d}.{suffix}"

    def read(self, index: int) -> FrameMaps:
        """The maps of frame ``index``."""
        rgb = read_rgb(self.images[index])
        require_size(self.images[index], rgb.shape, self.size_px)
        sky = self._sky(index)
        file = self.file("disp1", index, "dsp5")
        disparity = self._halved(file, hdf5_array(file, "disparity", 2))
        usable = np.isfinite(disparity) & (disparity > 0)
        usable &= True if sky is None else ~sky
        depth = self.focal_px[index] * BASELINE_M / np.where(usable, disparity, 1)
        last = len(self.images) - 1
        return FrameMaps(
            rgb=rgb,
            depth=np.where(usable, depth, 0).astype(np.float32),
            sky=sky,
            to_next=self._flow("flow_FW", index) if index < last else None,
            to_previous=self._flow("flow_BW", index) if index else None,
        )

    def _sky(self, index: int) -> np.ndarray | None:
        file = self.file("maps/skymap", index, "png")
        return self._halved(file, read_rgb(file)).any(-1) if file.parent.is_dir() else None

    def _flow(self, kind: str, index: int) -> FlowMap | None:
        file = self.file(kind, index, "flo5")
        if not file.parent.is_dir():
            return None
        offset_px = self._halved(file, hdf5_array(file, "flow", 3)).astype(np.float32)
        return FlowMap(offset_px=offset_px, known=np.isfinite(offset_px).all(-1))

    def _halved(self, file: Path, values: np.ndarray) -> np.ndarray:
        """Every second sample; values are pixels of the images already."""
        height, width = self.size_px
        require_size(file, values.shape, (2 * height, 2 * width))
        return values[::2, ::2]


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, lambda path: (path / "frame_left").is_dir()):
        yield ListedSequence(name=name_below(root, folder), open=lambda at=folder: _open(at))


def _open(folder: Path) -> Sequence:
    if not (folder / "cam_data").is_dir():
        raise InputError(
            f"{folder}: expected cam_data, got none; sequences of the test split have images alone"
        )
    intrinsics = number_rows(folder / "cam_data" / "intrinsics.txt", 4)
    file = folder / "cam_data" / "extrinsics.txt"
    extrinsics = poses.cleaned(number_rows(file, 16).reshape(-1, 4, 4), str(file))
    require_equal_counts(folder, {"intrinsics": len(intrinsics), "extrinsics": len(extrinsics)})
    eyes = [eye for eye in ("left", "right") if (folder / f"frame_{eye}").is_dir()]
    return Sequence(
        scene=folder.name,
        views=tuple(_view(folder, eye, intrinsics, extrinsics) for eye in eyes),
        times_s=np.arange(len(extrinsics)) / FPS,
    )


def _view(folder: Path, eye: str, intrinsics: np.ndarray, extrinsics: np.ndarray) -> SequenceView:
    images = numbered_files(folder / f"frame_{eye}", rf"frame_{eye}_(\d+)\.png")
    files = require_consecutive(images, 1)
    require_equal_counts(folder, {f"{eye} images": len(files), "poses": len(extrinsics)})
    camera_from_world = extrinsics.copy()
    camera_from_world[:, 0, 3] -= BASELINE_M if eye == "right" else 0.0
    size_px = read_rgb(files[0]).shape[:2]
    maps = _Eye(folder=folder, name=eye, images=files, size_px=size_px, focal_px=intrinsics[:, 0])
    return SequenceView(
        cameras=poses.cameras(poses.inverted(camera_from_world), intrinsics, size_px),
        read=maps.read,
    )


DATASET = Dataset(
    facts=DatasetFacts(name="spring", title="Spring", license="CC-BY-4.0", metric="exact"),
    expected_files="spring/train/0001/{frame_left, disp1_left, cam_data}",
    sequences=_sequences,
)
