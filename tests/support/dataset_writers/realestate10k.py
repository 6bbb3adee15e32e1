"""RealEstate10K: a text file per clip, images named by their time."""

from pathlib import Path

import numpy as np
from toy_scene import Truth

from dataset_writers.images import save

SIZE_PX, LENS = (36, 64), (50.0, 52.0, 32.0, 18.0)
START_US, STEP_US = 52553000, 33367
NAME = "000c3ab189999a83"


def write(truth: Truth, root: Path, poses: int | None = None) -> Path:
    lines = ["https://www.youtube.com/watch?v=abc"]
    height, width = truth.size_px
    fx, fy, cx, cy = truth.left.lens
    for t, pose in enumerate(truth.left.poses[:poses]):
        stamp = START_US + t * STEP_US
        save(truth.left.rgb[t], root / "train" / NAME / f"{stamp}.png")
        lens = (fx / width, fy / height, cx / width, cy / height, 0, 0)
        numbers = (*lens, *np.linalg.inv(pose)[:3].reshape(-1))
        lines.append(f"{stamp} " + " ".join(f"{number:.17g}" for number in numbers))
    (root / "train" / f"{NAME}.txt").write_text("\n".join(lines) + "\n")
    return root
