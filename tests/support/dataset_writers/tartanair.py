"""TartanAir v1: NED poses, quaternions x y z w, float32 depth in ``.npy``."""

from pathlib import Path

import numpy as np
from toy_scene import Eye, Truth

from dataset_writers.images import save

SIZE_PX, LENS, BASELINE_M = (48, 64), (32.0, 32.0, 32.0, 24.0), 0.25
SKY_M = 12000.0


def write(truth: Truth, root: Path) -> Path:
    folder = root / "abandonedfactory" / "Easy" / "P001"
    for name, eye in zip(("left", "right"), truth.eyes, strict=False):
        _write_eye(eye, folder, name)
    left = truth.left
    for t, flow in enumerate(left.forward):
        stem = folder / "flow" / f"{t:06d}_{t + 1:06d}"
        stem.parent.mkdir(exist_ok=True)
        np.save(f"{stem}_flow.npy", np.nan_to_num(flow).astype(np.float32))
        mask = np.where(left.forward_seen[t], 0, 10).astype(np.uint8)
        mask[~np.isfinite(flow[..., 0])] = 100
        np.save(f"{stem}_mask.npy", mask)
    return root


def _write_eye(eye: Eye, folder: Path, name: str) -> None:
    lines = []
    for t, pose in enumerate(eye.poses):
        save(eye.rgb[t], folder / f"image_{name}" / f"{t:06d}_{name}.png")
        depth = np.where(np.isfinite(eye.depth[t]), eye.depth[t], SKY_M).astype(np.float32)
        file = folder / f"depth_{name}" / f"{t:06d}_{name}_depth.npy"
        file.parent.mkdir(parents=True, exist_ok=True)
        np.save(file, depth)
        right, down, forward = pose[:3, 0], pose[:3, 1], pose[:3, 2]
        body = np.stack([forward, right, down], 1)
        lines.append(" ".join(f"{n:.17g}" for n in (*pose[:3, 3], *quaternion_xyzw(body))))
    (folder / f"pose_{name}.txt").write_text("\n".join(lines) + "\n")


def quaternion_xyzw(rotation: np.ndarray) -> np.ndarray:
    """The eigenvector of Bar-Itzhack's symmetric matrix with the largest eigenvalue."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    matrix = np.array(
        [
            [a - e - i, 0, 0, 0],
            [d + b, e - a - i, 0, 0],
            [g + c, h + f, i - a - e, 0],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    return np.linalg.eigh(matrix, UPLO="L")[1][:, -1]
