"""VKITTI2: rows of both cameras interleaved, centimetres, flow in three channels of 16 bits."""

from pathlib import Path

import cv2
import numpy as np
from toy_scene import Eye, Truth

from dataset_writers.images import save

SIZE_PX, LENS, BASELINE_M = (18, 60), (35.0, 35.0, 30.0, 9.0), 0.532725


def write(truth: Truth, root: Path) -> Path:
    folder = root / "Scene01" / "clone"
    lens_lines = ["frame cameraID K[0,0] K[1,1] K[0,2] K[1,2]"]
    pose_lines = ["frame cameraID r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0 0 1"]
    for t in range(truth.frames):
        for number, eye in enumerate(truth.eyes):
            _write_frame(eye, folder / "frames", number, t)
            fx, fy, cx, cy = eye.lens
            # Corners of pixels count here: the centre of the first pixel is 0, not 0.5.
            lens_lines.append(f"{t} {number} {fx} {fy} {cx - 0.5} {cy - 0.5}")
            row = np.linalg.inv(eye.poses[t]).reshape(-1)
            pose_lines.append(f"{t} {number} " + " ".join(f"{n:.12g}" for n in row))
    (folder / "intrinsic.txt").write_text("\n".join(lens_lines) + "\n")
    (folder / "extrinsic.txt").write_text("\n".join(pose_lines) + "\n")
    return root


def _write_frame(eye: Eye, frames: Path, number: int, t: int) -> None:
    place = f"Camera_{number}"
    save(eye.rgb[t], frames / "rgb" / place / f"rgb_{t:05d}.jpg")
    level = np.where(np.isfinite(eye.depth[t]), np.round(eye.depth[t] * 100), 65535)
    save(level.astype(np.uint16), frames / "depth" / place / f"depth_{t:05d}.png")
    if t < len(eye.poses) - 1:
        _flow(eye.forward[t], frames / "forwardFlow" / place / f"flow_{t:05d}.png")
    if t:
        name = f"backwardFlow_{t:05d}.png"
        _flow(eye.backward[t - 1], frames / "backwardFlow" / place / name)


def _flow(flow: np.ndarray, file: Path) -> None:
    height, width = flow.shape[:2]
    known = np.isfinite(flow).all(-1)
    share = np.nan_to_num(flow) / [width - 1, height - 1]
    # OpenCV stores blue, green, red.
    levels = np.zeros((height, width, 3), np.uint16)
    levels[..., 2] = np.round((share[..., 0] + 1) / 2 * 65535)
    levels[..., 1] = np.round((share[..., 1] + 1) / 2 * 65535)
    levels[..., 0] = np.where(known, 1, 0)
    file.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(file), levels)
