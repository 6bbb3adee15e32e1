"""PointOdyssey 1.2: world to camera, depth of 16 bits over 1000 m, archives of tracks."""

from pathlib import Path

import numpy as np
from toy_scene import Truth

from dataset_writers.images import save

SIZE_PX, LENS = (27, 48), (40.0, 41.0, 24.0, 13.5)
COLORS = np.array([[10, 200, 30], [250, 0, 9], [7, 7, 255], [0, 0, 0]], np.uint8)


def write(truth: Truth, root: Path, tracks: int | None = None) -> Path:
    """``tracks`` is what ``info.npz`` says of them; None is the truth."""
    folder = root / "train" / "ani_01"
    eye = truth.left
    for t in range(truth.frames):
        save(eye.rgb[t], folder / "rgbs" / f"rgb_{t:05d}.jpg")
        save(COLORS[eye.which[t]], folder / "masks" / f"mask_{t:05d}.png")
        level = np.floor(np.where(np.isfinite(eye.depth[t]), eye.depth[t], 1000) / 1000 * 65535)
        save(level.astype(np.uint16), folder / "depths" / f"depth_{t:05d}.png")
    count = truth.uv.shape[1]
    uv = truth.uv.astype(np.float32)
    uv[1, 0], uv[2, 1] = np.inf, np.nan
    valid = np.ones((truth.frames, count), bool)
    valid[3, 2] = False
    fx, fy, cx, cy = eye.lens
    np.savez_compressed(
        folder / "anno.npz",
        trajs_2d=uv,
        trajs_3d=truth.positions.astype(np.float32),
        visibs=truth.visible.astype(np.float16),
        valids=valid.astype(np.float16),
        intrinsics=np.tile([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], (truth.frames, 1, 1)).astype(
            "f4"
        ),
        extrinsics=np.linalg.inv(eye.poses).astype(np.float32),
    )
    shape = np.array([truth.frames, count if tracks is None else tracks, 3])
    np.savez(folder / "info.npz", trajs_3d=shape if tracks != 0 else np.array([]))
    return root
