"""Image files as other programs write them."""

from pathlib import Path

import cv2
import numpy as np
from PIL import Image


def save(pixels: np.ndarray, file: Path) -> None:
    """PNG, or JPEG of the best quality."""
    file.parent.mkdir(parents=True, exist_ok=True)
    options = {"quality": 100, "subsampling": 0} if file.suffix == ".jpg" else {}
    Image.fromarray(pixels).save(file, **options)


def save_movie(frames: np.ndarray, file: Path, fps: float) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    size = frames.shape[2], frames.shape[1]
    stream = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"mp4v"), fps, size)
    for frame in frames:
        stream.write(np.ascontiguousarray(frame[..., ::-1]))
    stream.release()
