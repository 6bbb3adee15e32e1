"""MultiCamVideo: row-vector matrices of Unreal in JSON, some of them without the last column."""

import json
from pathlib import Path

import numpy as np
from toy_scene import Truth

from dataset_writers.images import save_movie

SIZE_PX = (64, 64)
LENS = (24 / 23.76 * 64, 24 / 23.76 * 64, 32.0, 32.0)
BASELINE_M = 0.4


def write(truth: Truth, root: Path) -> Path:
    folder = root / "train" / "f24_aperture5" / "scene7"
    document: dict[str, dict[str, str]] = {}
    for number, eye in enumerate(truth.eyes, 1):
        save_movie(eye.rgb, folder / "videos" / f"cam{number:02d}.mp4", 15)
        for t, pose in enumerate(eye.poses):
            short = (t + number) % 2
            document.setdefault(f"frame{t}", {})[f"cam{number:02d}"] = _text(pose, bool(short))
    file = folder / "cameras" / "camera_extrinsics.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(document))
    return root


def _unreal(vector: np.ndarray) -> np.ndarray:
    """x right, y down, z forward becomes forward, right, up."""
    right, down, forward = vector
    return np.array([forward, right, -down])


def _text(pose: np.ndarray, short: bool) -> str:
    rows = [
        _unreal(pose[:3, 2]),
        _unreal(pose[:3, 0]),
        _unreal(-pose[:3, 1]),
        _unreal(pose[:3, 3]) * 100,
    ]
    parts = []
    for place, row in enumerate(rows):
        last = [] if short else [f"{int(place == 3)}"]
        parts.append("[" + " ".join([*(f"{number:.10g}" for number in row), *last]) + "]")
    return " ".join(parts) + " "
