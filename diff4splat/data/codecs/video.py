"""Images of all frames as MP4: small, with loss. Axes: ``t`` frames, ``h w 3`` bytes."""

import tempfile
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.errors import FileFormatError
from diff4splat.io.pixels import from_bytes
from diff4splat.io.silence_stderr import silence_native_stderr
from diff4splat.io.video import write_video


def encode_mp4(frames: UInt8[np.ndarray, "t h w 3"], fps: float) -> bytes:
    """The file that ``write_video`` writes."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.mp4"
        write_video((from_bytes(frame) for frame in frames), file, fps)
        return file.read_bytes()


def decode_mp4(content: bytes, shape: tuple[int, ...]) -> UInt8[np.ndarray, "t h w 3"]:
    """Frames of ``shape``; rows and columns that made odd sizes even are cut off.

    Raises:
        FileFormatError: damaged, or of another length or size.
    """
    size_px = (shape[1] + shape[1] % 2, shape[2] + shape[2] % 2)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.mp4"
        file.write_bytes(content)
        with silence_native_stderr():
            frames = _decode(file, shape[0] + 1, size_px)
    if len(frames) != shape[0] or {frame.shape[:2] for frame in frames} != {size_px}:
        got = frames[0].shape[:2] if frames else "nothing"
        raise FileFormatError(
            f"expected an MP4 of {shape[0]} frames of (height, width) {size_px}, "
            f"got {len(frames)} of {got}; copy it again"
        )
    return np.stack([frame[: shape[1], : shape[2], ::-1] for frame in frames])


def _decode(file: Path, most: int, size_px: tuple[int, int]) -> list[np.ndarray]:
    """Up to ``most`` frames of ``size_px``: hours of video are not decoded to be refused."""
    reader = cv2.VideoCapture(str(file), cv2.CAP_FFMPEG)
    frames: list[np.ndarray] = []
    sides = (cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_WIDTH)
    fits = tuple(int(reader.get(side)) for side in sides) == size_px
    while fits and len(frames) < most:
        decoded, frame = reader.read()
        if not decoded:
            break
        frames.append(frame)
    reader.release()
    return frames
