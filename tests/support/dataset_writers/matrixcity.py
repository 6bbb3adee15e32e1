"""MatrixCity: OpenGL poses in both files, depth in centimetres in OpenEXR, tar or PNG."""

import json
import math
import tarfile
from pathlib import Path

import numpy as np
import OpenEXR
from toy_scene import Truth

from dataset_writers.images import save

SIZE_PX = (32, 32)
LENS = (16.0, 16.0, 16.0, 16.0)


def write(truth: Truth, root: Path, half: bool = True) -> Path:
    """A street block with its own poses."""
    folder = root / "small_city" / "street" / "train" / "block_A"
    frames = []
    for t, pose in enumerate(truth.left.poses):
        save(truth.left.rgb[t], folder / f"{t:04d}.png")
        _depth(truth.left.depth[t], root, half, t)
        matrix = opengl(pose)
        matrix[:3, :3] /= 100
        frames.append({"frame_index": t, "rot_mat": matrix.tolist()})
    (folder / "transforms.json").write_text(
        json.dumps({"camera_angle_x": math.pi / 2, "frames": frames})
    )
    return root


def write_packaged(truth: Truth, root: Path) -> Path:
    """The same block with the poses of the ``pose`` folder."""
    write(truth, root, half=False)
    kind = root / "small_city" / "street"
    (kind / "train" / "block_A" / "transforms.json").unlink()
    frames = []
    for t, pose in enumerate(truth.left.poses):
        matrix = opengl(pose)
        matrix[:3, 3] /= 100
        path = f"../../train/block_A/{t:04d}.png"
        frames.append({"file_path": path, "transform_matrix": matrix.tolist()})
    height, width = SIZE_PX
    document = {
        "camera_angle_x": math.pi / 2,
        "fl_x": LENS[0],
        "fl_y": LENS[1],
        "cx": LENS[2],
        "cy": LENS[3],
        "w": width,
        "h": height,
        "k1": 0,
        "frames": frames,
    }
    file = kind / "pose" / "block_A" / "transforms_train.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(document))
    return root


def pack(root: Path, prefix: str = "block_A/") -> None:
    """The images into a tar beside the poses."""
    folder = root / "small_city" / "street" / "train" / "block_A"
    with tarfile.open(folder / "block_A.tar", "w") as tar:
        for image in sorted(folder.glob("*.png")):
            tar.add(image, prefix + image.name)
            image.unlink()


def opengl(pose: np.ndarray) -> np.ndarray:
    """Columns right, up, backwards."""
    matrix = np.eye(4)
    matrix[:3] = np.stack([pose[:3, 0], -pose[:3, 1], -pose[:3, 2], pose[:3, 3]], 1)
    return matrix


def _depth(depth_m: np.ndarray, root: Path, half: bool, t: int) -> None:
    city = "small_city_depth" if half else "small_city_depth_float32"
    file = root / city / "street" / "train" / "block_A" / f"{t:04d}.exr"
    file.parent.mkdir(parents=True, exist_ok=True)
    nothing = 65504.0 if half else 3.0e7
    level = np.where(np.isfinite(depth_m), depth_m * 100, nothing)
    level = np.ascontiguousarray(level.astype(np.float16 if half else np.float32))
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"B": level, "G": level, "R": level}) as opened:
        opened.write(str(file))
