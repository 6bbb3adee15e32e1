"""Videos as MP4: VP9, which plays in browsers, or MPEG-4 Part 2 where OpenCV lacks VP9.

Axes: ``t`` frames, ``h w 3`` RGB in [0, 1]. Both codecs store colour at half resolution, so odd
sizes are padded to even ones by repeating the last row or column.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, OutputError, ShapeError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.pixels import to_bytes
from diff4splat.io.silence_stderr import silence_native_stderr

_CODECS = ("vp09", "mp4v")
Frame = Float[Tensor, "h w 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenVideo:
    """What became of the frames."""

    frame_count: int
    size_px: tuple[int, int]
    """(height, width) in the file, both even."""
    notes: tuple[str, ...] = ()
    """What differs from the frames as given, in words."""


def write_video(
    frames: Iterable[Frame] | Float[Tensor, "t h w 3"],
    file: Path | str,
    fps: float,
    advance: Callable[[], None] = lambda: None,
) -> WrittenVideo:
    """Write frames as they come, whole or not at all; ``advance`` is called after each.

    Raises:
        ConfigError: the name does not end in .mp4, or ``fps`` is not a number above 0.
        InputError: there are no frames.
        ShapeError: the frames are not of one size.
        OutputError: no codec, the folder cannot be written, or the disk is full.
    """
    file = Path(file)
    if file.suffix.lower() != ".mp4":
        raise ConfigError(f"{file}: expected a name ending in .mp4, got '{file.suffix}'; rename it")
    if not (math.isfinite(fps) and fps > 0):
        raise ConfigError(f"fps: expected a number above 0, got {fps}")
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise InputError(f"{file}: expected at least one frame, got none")
    shape = tuple(first.shape)
    _require_frame(first, 0, shape)
    with atomic_path(file) as temporary:
        with _opened(temporary, fps, _even(shape), file) as (writer, codec):
            count = _write_all(writer, first, rest, advance)
        _verify(temporary, count, file)
    return WrittenVideo(frame_count=count, size_px=_even(shape), notes=_notes(shape, codec))


def _require_frame(frame: Tensor, number: int, shape: tuple[int, ...]) -> None:
    got = tuple(frame.shape)
    if len(got) != 3 or got[2] != 3 or 0 in got or got != shape:
        like = "" if got == shape else f" like the first one, {shape}"
        raise ShapeError(f"frame {number}: expected (height, width, 3){like}, got {got}")


def _even(shape: tuple[int, ...]) -> tuple[int, int]:
    return shape[0] + shape[0] % 2, shape[1] + shape[1] % 2


def _notes(shape: tuple[int, ...], codec: str) -> tuple[str, ...]:
    notes: tuple[str, ...] = ()
    height, width = _even(shape)
    if (height, width) != shape[:2]:
        before, after = f"{shape[1]}x{shape[0]}", f"{width}x{height}"
        notes += (f"padded from {before} to {after}, since video needs even sizes",)
    if codec != _CODECS[0]:
        notes += ("written as MPEG-4, since VP9 is missing here; browsers may not play it",)
    return notes


@contextmanager
def _opened(
    temporary: Path, fps: float, size_px: tuple[int, int], file: Path
) -> Iterator[tuple[cv2.VideoWriter, str]]:
    """A writer with the first codec that opens, finished or abandoned at the end of the block."""
    temporary.touch()  # names the trouble with the folder, which OpenCV would not
    for codec in _CODECS:
        with silence_native_stderr():
            code = cv2.VideoWriter.fourcc(*codec)
            writer = cv2.VideoWriter(str(temporary), cv2.CAP_FFMPEG, code, fps, size_px[::-1])
        if writer.isOpened():
            break
    else:
        raise OutputError(
            f"{file}: expected an OpenCV that writes VP9 or MPEG-4, got one with neither; "
            "install opencv-contrib-python-headless from PyPI"
        )
    try:
        yield writer, codec
    finally:
        with silence_native_stderr():
            writer.release()


def _write_all(
    writer: cv2.VideoWriter, first: Frame, rest: Iterator[Frame], advance: Callable[[], None]
) -> int:
    count, frame = 0, first
    while frame is not None:
        _require_frame(frame, count, tuple(first.shape))
        writer.write(_bgr(frame))
        count += 1
        advance()
        frame = next(rest, None)
    return count


def _bgr(frame: Frame) -> UInt8[np.ndarray, "h2 w2 3"]:
    """OpenCV's channel order and an even size."""
    height, width = frame.shape[:2]
    padding = ((0, height % 2), (0, width % 2), (0, 0))
    return np.ascontiguousarray(np.pad(to_bytes(frame), padding, mode="edge")[..., ::-1])


def _verify(temporary: Path, count: int, file: Path) -> None:
    """Decode what was written: OpenCV does not report a full disk."""
    with silence_native_stderr():
        reader = cv2.VideoCapture(str(temporary), cv2.CAP_FFMPEG)
        found = 0
        while reader.grab():
            found += 1
        reader.release()
    if found != count:
        raise OutputError(
            f"{file}: expected {count} frames in the finished video, got {found}; "
            "the disk may be full, free some space or choose another folder"
        )
