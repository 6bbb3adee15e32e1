"""TartanAir (version 1): static synthetic scenes, two eyes, true depth and flow of the left one.

Poses are camera to world in NED (x forward, y right, z down), quaternions x, y, z, w. Depth of the
sky is of the order of 1e4 m. Flow follows from depth and cameras alone: it is wrong on the few
things that move. Source: castacks/tartanair_tools.
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
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.data_prep.datasets.files.text_table import number_rows
from diff4splat.data_prep.readers.files.float_files import npy_array
from diff4splat.errors import FileFormatError, InputError

SKY_M = 1000.0
"""Depth from here on is sky."""
_FOCAL_PX, _SIZE_PX = 320.0, (480, 640)
_CV_IN_NED = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Columns: x of the image is y of NED, y is z, and z is x."""
_SECOND_VERSION = ("pose_lcam_front.txt", "image_lcam_front")


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for folder in folders_below(root, _is_sequence):
        yield ListedSequence(name=name_below(root, folder), open=lambda at=folder: _open(at))


def _is_sequence(folder: Path) -> bool:
    if any((folder / name).exists() for name in _SECOND_VERSION):
        raise InputError(
            f"{folder}: expected TartanAir version 1, got TartanAir V2, another format (12 "
            "cameras, depth in 8-bit PNG); give a copy of version 1"
        )
    return (folder / "pose_left.txt").is_file()


def _open(folder: Path) -> Sequence:
    eyes = [eye for eye in ("left", "right") if (folder / f"image_{eye}").is_dir()]
    if not eyes or eyes[0] != "left":
        raise FileFormatError(f"{folder}: expected image_left, got no such folder; unpack it too")
    views = {eye: _view(folder, eye) for eye in eyes}
    if len(views) == 2:
        left, right = (view.cameras.world_from_camera.numpy() for view in views.values())
        require_equal_counts(folder, {"left images": len(left), "right images": len(right)})
        poses.require_right_of(left, right, str(folder))
    return Sequence(
        scene=folder.parent.parent.name,
        views=tuple(views.values()),
        times_s=np.arange(len(views["left"].cameras), dtype=np.float64),
    )


def _view(folder: Path, eye: str) -> SequenceView:
    images = numbered_files(folder / f"image_{eye}", rf"(\d+)_{eye}\.png")
    files = require_consecutive(images, min(images))
    rows = number_rows(folder / f"pose_{eye}.txt", 7)
    require_equal_counts(folder, {f"{eye} images": len(files), "poses": len(rows)})
    size_px = read_rgb(files[0]).shape[:2]

    def read(index: int) -> FrameMaps:
        stem = files[index].stem
        rgb = read_rgb(files[index])
        require_size(files[index], rgb.shape, size_px)
        far_m = _floats(folder / f"depth_{eye}" / f"{stem}_depth.npy", size_px)
        sky = ~(far_m < SKY_M)
        depth = np.where(sky | ~(far_m > 0), np.float32(0), far_m)
        flow = _flow(folder, files, index, size_px) if eye == "left" else None
        return FrameMaps(rgb=rgb, depth=depth, sky=sky, to_next=flow)

    world_from_camera = poses.cleaned(_from_ned(rows), str(folder / f"pose_{eye}.txt"))
    return SequenceView(
        cameras=poses.cameras(world_from_camera, _intrinsics(size_px, len(rows)), size_px),
        read=read,
    )


def _from_ned(rows: Float64[np.ndarray, "t 7"]) -> Float64[np.ndarray, "t 4 4"]:
    """The world stays in NED; the axes of the camera become OpenCV's."""
    length = np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    if (length < 0.5).any():
        raise FileFormatError("poses: expected unit quaternions x y z w, got one near 0")
    x, y, z, w = (rows[:, 3:] / length).T
    rotation = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        1,
    )
    return poses.from_parts(rotation @ _CV_IN_NED, rows[:, :3])


def _intrinsics(size_px: tuple[int, int], count: int) -> Float64[np.ndarray, "t 4"]:
    """90 degrees across; images that somebody resized keep that."""
    height, width = size_px
    focal = (_FOCAL_PX * width / _SIZE_PX[1], _FOCAL_PX * height / _SIZE_PX[0])
    return np.tile([*focal, width / 2, height / 2], (count, 1))


def _flow(folder: Path, files: list[Path], index: int, size_px: tuple[int, int]) -> FlowMap | None:
    if index + 1 >= len(files) or not (folder / "flow").is_dir():
        return None
    numbers = "_".join(file.stem.split("_")[0] for file in files[index : index + 2])
    offset_px = _floats(folder / "flow" / f"{numbers}_flow.npy", (*size_px, 2))
    mask_file = folder / "flow" / f"{numbers}_mask.npy"
    mask = np.asarray(npy_array(mask_file))
    require_size(mask_file, mask.shape, size_px)
    known = np.isfinite(offset_px).all(-1)
    return FlowMap(offset_px=offset_px, known=known, visible=known & (mask == 0))


def _floats(file: Path, shape: tuple[int, ...]) -> np.ndarray:
    values = npy_array(file)
    if values.dtype != np.float32 or values.shape != shape:
        raise FileFormatError(
            f"{file}: expected float32 of shape {shape}, got {values.dtype} of shape "
            f"{values.shape}; it is of another version or was converted"
        )
    return np.array(values)


DATASET = Dataset(
    facts=DatasetFacts(
        name="tartanair",
        title="TartanAir v1",
        license="CC-BY-4.0",
        metric="exact",
        is_static=True,
        timed=False,
    ),
    expected_files="ENV/Easy/P000/{pose_left.txt, image_left, depth_left}",
    sequences=_sequences,
)
