"""Frames of a video, decoded in order, with a bounded cache of recent frames.

Reading an earlier frame restarts the video, since seeking is inexact in common codecs. Sequential
access is therefore fast, and random access in a long video is slow.
"""

from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.data_prep.readers.files.image_file import Pixels
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import require_file
from diff4splat.io.silence_stderr import silence_native_stderr

CACHE_BYTES = 1 << 30
"""For all videos of a capture together."""
MAX_FRAMES, MAX_PIXELS = 1_000_000, 100_000_000


class VideoFile:
    """One video, downscaled by ``shrink`` to 8-bit block means."""

    def __init__(self, file: Path, shrink: int, cache: LruCache) -> None:
        """Look at the head of the file.

        Raises:
            FileFormatError: missing, or not a video that can be decoded.
        """
        require_file(file, "a video")
        self.file, self.shrink, self._cache, self._lock = file, shrink, cache, Lock()
        # Only here: what silences the decoder is not safe between threads, and reading has to be.
        with silence_native_stderr():
            self._open()
        self.frames = int(self._stream.get(cv2.CAP_PROP_FRAME_COUNT))
        self.fps = float(self._stream.get(cv2.CAP_PROP_FPS))
        height = int(self._stream.get(cv2.CAP_PROP_FRAME_HEIGHT))
        width = int(self._stream.get(cv2.CAP_PROP_FRAME_WIDTH))
        self.full_size_px = (height, width)
        if min(self.frames, height, width) < 1:
            raise FileFormatError(f"{file}: expected a video with frames, got none; copy it again")
        # A header can claim any number; a frame takes a byte at least.
        if self.frames > min(MAX_FRAMES, file.stat().st_size) or height * width > MAX_PIXELS:
            raise FileFormatError(
                f"{file}: expected up to {MAX_FRAMES:,} frames of up to {MAX_PIXELS:,} pixels, got "
                f"{self.frames:,} of {width} x {height} in {file.stat().st_size:,} bytes; the "
                "video is damaged, copy it again"
            )

    @property
    def size_px(self) -> tuple[int, int]:
        """(height, width) of what ``read`` gives."""
        return self.full_size_px[0] // self.shrink, self.full_size_px[1] // self.shrink

    def read(self, index: int) -> UInt8[np.ndarray, "h w 3"]:
        """Frame ``index``, RGB.

        Raises:
            FileFormatError: the video ends before it.
        """
        with self._lock:
            found = self._cache.get((self.file, index))
            return self._decoded(index) if found is None else found[0]

    def _open(self) -> None:
        self._stream = cv2.VideoCapture(str(self.file), cv2.CAP_FFMPEG)
        if not self._stream.isOpened():
            raise FileFormatError(
                f"{self.file}: expected a video, got a damaged or other file; copy it again"
            )
        self._next = 0

    def _decoded(self, index: int) -> UInt8[np.ndarray, "h w 3"]:
        if index < self._next:
            self._stream.release()
            self._open()
        while self._next <= index:
            whole, levels = self._stream.read()
            if not whole:
                raise FileFormatError(
                    f"{self.file}: expected {self.frames} frames, got {self._next}; the video is "
                    "cut off or damaged, copy it again"
                )
            rgb = self._shrunk(cv2.cvtColor(levels, cv2.COLOR_BGR2RGB))
            self._cache.put((self.file, self._next), (rgb,))
            self._next += 1
        return rgb

    def _shrunk(self, rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "p q 3"]:
        if self.shrink == 1:
            return rgb
        height, width = self.size_px
        inner = rgb[: height * self.shrink, : width * self.shrink]
        return cv2.resize(inner, (width, height), interpolation=cv2.INTER_AREA)


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFrame:
    """One frame of a video."""

    video: VideoFile
    frame: int

    @property
    def where(self) -> str:
        """Name for error messages."""
        return f"{self.video.file}: frame {self.frame}"

    @property
    def is_float(self) -> bool:
        """Never."""
        return False

    def size_px(self) -> tuple[int, int]:
        """(height, width)."""
        return self.video.size_px

    def has_alpha(self) -> bool:
        """Never."""
        return False

    def read(self) -> Pixels:
        """The image.

        Raises:
            FileFormatError: the video ends before it.
        """
        rgb = self.video.read(self.frame).astype(np.float32) / np.float32(255)
        return Pixels(rgb=rgb, from_levels=True)
