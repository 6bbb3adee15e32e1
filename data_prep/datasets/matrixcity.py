"""MatrixCity: static synthetic cities from the air and the street; both kinds of pose file.

``transforms.json`` of a block has ``rot_mat`` with the rotation divided by 100 and metres;
``pose/BLOCK/transforms_*.json`` has ``transform_matrix`` with an orthonormal rotation and units of
100 m. Both are OpenGL's camera to world. Depth is OpenEXR in centimetres; 65504 in half precision
is nothing. Indices are no video: images are grouped by viewing direction and ordered by place.
Source: city-super/MatrixCity.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.folders import folders_below, name_below
from diff4splat.data_prep.datasets.common.grid_paths import grid_paths
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FrameMaps,
    ListedSequence,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.rgb_image import decode_rgb, read_rgb, require_size
from diff4splat.data_prep.datasets.files.tar_images import TarImages
from diff4splat.data_prep.readers.files.float_files import exr_channels
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.errors import FileFormatError

FARTHEST_M = 2000.0
"""In float32, which has no number for nothing."""
_NOTHING_CM = 65504.0
_EDGE = 0.1
"""Relative depth step at which pixels mix two surfaces."""
_CV_FROM_GL = np.array([1.0, -1, -1])
_FIELD_OF_VIEW_DEG = {"aerial": 45.0, "street": 90.0}


@dataclass(frozen=True)
class _Block:
    """Images and depth of one block."""

    folder: Path
    """``CITY/{aerial,street}/SPLIT/BLOCK``"""

    @cached_property
    def tar(self) -> TarImages | None:
        """The images where they are not unpacked."""
        file = self.folder / f"{self.folder.name}.tar"
        return TarImages(file) if file.is_file() else None

    def rgb(self, name: str) -> np.ndarray:
        """One image, unpacked or out of the tar."""
        file = self.folder / name
        if not file.is_file() and self.tar is not None:
            return decode_rgb(self.tar.read(name), f"{self.tar.file}, {name}")
        return read_rgb(file)

    def depth(self, name: str, size_px: tuple[int, int]) -> np.ndarray | None:
        """Metres; None without any folder of depth."""
        for suffix in ("_depth_float32", "_depth"):
            folder = self._sibling(suffix)
            if folder.is_dir():
                file = folder / f"{Path(name).stem}.exr"
                return _metres(file, size_px, half=suffix == "_depth")
        return None

    def _sibling(self, suffix: str) -> Path:
        kind, split, block = self.folder.parts[-3:]
        city = self.folder.parents[2]
        return city.with_name(city.name + suffix) / kind / split / block


def _metres(file: Path, size_px: tuple[int, int], half: bool) -> np.ndarray:
    channels = exr_channels(file)
    name = next((name for name in ("B", "Z", "Y", "R") if name in channels), None)
    if name is None:
        raise FileFormatError(f"{file}: expected depth in channel B, got {sorted(channels)[:6]}")
    centimetres = channels[name].astype(np.float32)
    require_size(file, centimetres.shape, size_px)
    nothing = ~np.isfinite(centimetres) | (centimetres <= 0)
    nothing |= centimetres >= (_NOTHING_CM if half else 100 * FARTHEST_M)
    depth = np.where(nothing, np.float32(0), centimetres / np.float32(100))
    return np.where(_is_edge(depth), np.float32(0), depth)


def _is_edge(depth: np.ndarray) -> np.ndarray:
    """Edges are anti-aliased: their depth is between two surfaces, on none."""
    kernel = np.ones((3, 3), np.uint8)
    nearest = cv2.erode(depth, kernel)
    return cv2.dilate(depth, kernel) > np.maximum(nearest, 1e-6) * (1 + _EDGE)


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, lambda path: bool(_pose_files(path))):
        for file in _pose_files(folder):
            yield from _listed(root, file)


def _pose_files(folder: Path) -> list[Path]:
    raw = folder / "transforms.json"
    if raw.is_file() and folder.parent.name != "pose":
        return [raw]
    if folder.parent.name != "pose":
        return []
    packaged = sorted(folder.glob("transforms_*.json"))
    # A block that is unpacked with its own poses is there twice.
    return [file for file in packaged if not (_block_of(file) / "transforms.json").is_file()]


def _block_of(packaged: Path) -> Path:
    """The block of ``KIND/pose/BLOCK/transforms_SPLIT.json``."""
    split = packaged.stem.removeprefix("transforms_")
    return packaged.parents[2] / split / packaged.parent.name


def _listed(root: Path, file: Path) -> Iterator[ListedSequence]:
    document = read_object(file)
    frames = document.get("frames")
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise FileFormatError(f"{file}: expected 'frames', got {list(document)[:6]}")
    raw = file.name == "transforms.json"
    folder = file.parent if raw else _block_of(file)
    made = [_pose_and_name(frame, file) for frame in frames]
    world_from_camera = poses.cleaned(np.stack([pose for pose, _ in made]), str(file))
    names, block = [name for _, name in made], _Block(folder)
    for number, path in enumerate(grid_paths(world_from_camera)):

        def opened(path: np.ndarray = path) -> Sequence:
            chosen = [names[index] for index in path]
            return _open(block, chosen, world_from_camera[path], document)

        yield ListedSequence(name=f"{name_below(root, folder)}/{number:04d}", open=opened)


def _pose_and_name(frame: dict[str, Any], file: Path) -> tuple[np.ndarray, str]:
    """OpenCV pose in metres, and the file name of the image."""
    key = "rot_mat" if "rot_mat" in frame else "transform_matrix"
    try:
        pose = np.array(frame[key], np.float64).reshape(4, 4)
        name = f"{int(frame['frame_index']):04d}.png" if key == "rot_mat" else frame["file_path"]
        name = Path(str(name).replace("\\", "/")).name
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: expected '{key}' of 16 numbers and an image") from error
    pose[3] = (0, 0, 0, 1)
    if key == "rot_mat":
        pose[:3, :3] *= 100
    else:
        pose[:3, 3] *= 100
    pose[:3, :3] *= _CV_FROM_GL
    return pose, name


def _open(
    block: _Block, names: list[str], world_from_camera: np.ndarray, document: dict[str, Any]
) -> Sequence:
    size_px = block.rgb(names[0]).shape[:2]

    def read(index: int) -> FrameMaps:
        rgb = block.rgb(names[index])
        require_size(block.folder / names[index], rgb.shape, size_px)
        return FrameMaps(rgb=rgb, depth=block.depth(names[index], size_px))

    lens = np.tile(_intrinsics(document, size_px, block.folder), (len(names), 1))
    view = SequenceView(cameras=poses.cameras(world_from_camera, lens, size_px), read=read)
    return Sequence(
        scene="/".join(block.folder.parts[-4:]),
        views=(view,),
        times_s=np.arange(len(names), dtype=np.float64),
    )


def _intrinsics(document: dict[str, Any], size_px: tuple[int, int], folder: Path) -> list[float]:
    """(fx, fy, cx, cy), as stated or from the field of view; scaled where images were resized."""
    height, width = size_px
    angle = document.get("camera_angle_x")
    if angle is None:
        degrees = _FIELD_OF_VIEW_DEG.get(folder.parent.parent.name)
        if degrees is None and "fl_x" not in document:
            raise FileFormatError(f"{folder}: expected camera_angle_x or a folder aerial or street")
        angle = math.radians(degrees or 45.0)
    focal = width / (2 * math.tan(float(angle) / 2))
    if not {"fl_x", "fl_y", "cx", "cy", "w", "h"} <= document.keys():
        return [focal, focal, width / 2, height / 2]
    across, down = width / float(document["w"]), height / float(document["h"])
    return [
        float(document["fl_x"]) * across,
        float(document["fl_y"]) * down,
        float(document["cx"]) * across,
        float(document["cy"]) * down,
    ]


DATASET = Dataset(
    facts=DatasetFacts(
        name="matrixcity",
        title="MatrixCity",
        license="CC-BY-NC-4.0",
        metric="exact",
        is_static=True,
        timed=False,
    ),
    expected_files="small_city/aerial/train/BLOCK/transforms.json or aerial/pose/BLOCK",
    sequences=_sequences,
)
