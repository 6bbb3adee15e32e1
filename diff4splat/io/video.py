"""VP9 videos in MP4, VP8 in WebM; MPEG-4 Part 2 in MP4 where OpenCV lacks VP9.

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
_WEBM_CODECS = ("VP80",)
"""VP9 takes five times as long for half a decibel, and OpenCV passes no speed on to it."""
_WEBM_HEAD_BYTES, _TRACK_UID = 4096, b"\x73\xc5\x88"
"""Identifier and length of the element before its eight bytes."""
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
        ConfigError: the name ends in neither .mp4 nor .webm, or ``fps`` is not a number above 0.
        InputError: there are no frames.
        ShapeError: the frames are not of one size.
        OutputError: no codec, the folder cannot be written, or the disk is full.
    """
    file = Path(file)
    if file.suffix.lower() not in (".mp4", ".webm"):
        raise ConfigError(
            f"{file}: expected a name ending in .mp4 or .webm, got '{file.suffix}'; rename it"
        )
    first, rest = first_frame(frames, file, fps)
    shape = tuple(first.shape)
    with atomic_path(file) as temporary:
        with _opened(temporary, fps, _even(shape), file) as (writer, codec):
            count = _write_all(writer, first, rest, advance)
        if file.suffix.lower() == ".webm":
            _fix_track_number(temporary)
        require_frame_count(temporary, count, file)
    return WrittenVideo(frame_count=count, size_px=_even(shape), notes=_notes(shape, codec))


def first_frame(frames: Iterable[Frame], file: Path, fps: float) -> tuple[Frame, Iterator[Frame]]:
    """The first frame and the others, once the frame rate and that frame are valid.

    Raises:
        ConfigError: ``fps`` is not a number above 0.
        InputError: there are no frames.
        ShapeError: the frame is no RGB image.
    """
    if not (math.isfinite(fps) and fps > 0):
        raise ConfigError(f"fps: expected a number above 0, got {fps}")
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise InputError(f"{file}: expected at least one frame, got none")
    require_frame(first, 0, tuple(first.shape))
    return first, rest


def require_frame(frame: Tensor, number: int, shape: tuple[int, ...]) -> None:
    """Require an RGB image like the first frame, of ``shape``.

    Raises:
        ShapeError: it is another.
    """
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
    if codec == "mp4v":
        notes += ("written as MPEG-4, since VP9 is missing here; browsers may not play it",)
    return notes


@contextmanager
def _opened(
    temporary: Path, fps: float, size_px: tuple[int, int], file: Path
) -> Iterator[tuple[cv2.VideoWriter, str]]:
    """A writer with the first codec that opens, finished or abandoned at the end of the block."""
    temporary.touch()  # names the trouble with the folder, which OpenCV would not
    for codec in _WEBM_CODECS if temporary.suffix.lower() == ".webm" else _CODECS:
        with silence_native_stderr(brief=True):  # FFmpeg has no tag for this codec in WebM
            code = cv2.VideoWriter.fourcc(*codec)
            writer = cv2.VideoWriter(str(temporary), cv2.CAP_FFMPEG, code, fps, size_px[::-1])
        if writer.isOpened():
            break
    else:
        raise OutputError(
            f"{file}: expected an OpenCV that writes VP8, VP9 or MPEG-4, got one without; "
            "install opencv-contrib-python-headless from PyPI"
        )
    try:
        yield writer, codec
    finally:
        with silence_native_stderr():
            writer.release()


def _fix_track_number(temporary: Path) -> None:
    """A constant in place of the random number that Matroska gives a track (TrackUID)."""
    with temporary.open("r+b") as opened:
        head = opened.read(_WEBM_HEAD_BYTES)
        place = head.find(_TRACK_UID) + len(_TRACK_UID)
        if place < len(_TRACK_UID):
            return
        opened.seek(0)
        opened.write(head.replace(head[place : place + 8], (1).to_bytes(8, "big")))


def _write_all(
    writer: cv2.VideoWriter, first: Frame, rest: Iterator[Frame], advance: Callable[[], None]
) -> int:
    count, frame = 0, first
    while frame is not None:
        require_frame(frame, count, tuple(first.shape))
        writer.write(_bgr(frame))
        count += 1
        advance()
        frame = next(rest, None)
    return count


def even_bytes(frame: Frame) -> UInt8[np.ndarray, "h2 w2 3"]:
    """RGB bytes of an even size."""
    height, width = frame.shape[:2]
    padding = ((0, height % 2), (0, width % 2), (0, 0))
    return np.ascontiguousarray(np.pad(to_bytes(frame), padding, mode="edge"))


def _bgr(frame: Frame) -> UInt8[np.ndarray, "h2 w2 3"]:
    """OpenCV's channel order and an even size."""
    return np.ascontiguousarray(even_bytes(frame)[..., ::-1])


def require_frame_count(temporary: Path, count: int, file: Path) -> None:
    """Decode what was written: OpenCV does not report a full disk.

    Raises:
        OutputError: another number of frames.
    """
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
