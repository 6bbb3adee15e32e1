"""A movie that is encoded beside other work: encoding and rendering both release Python's lock.

Axes: ``h w 3`` RGB in [0, 1].
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Full, Queue
from typing import Any

from diff4splat.io.movies.movie import write_movie
from diff4splat.io.video import Frame

WAITING_FRAMES = 8
"""Frames in memory that the encoder has not taken yet."""
_POLL_S = 0.1


class _AbandonedError(Exception):
    """The file is not wanted any more."""


class BackgroundMovie:
    """A context manager that takes frames one by one; without ``finish`` no file is left."""

    def __init__(self, file: Path, fps: float) -> None:
        self._frames: Queue[Frame | _AbandonedError | None] = Queue(WAITING_FRAMES)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="diff4splat-movie")
        self._written = self._pool.submit(write_movie, self._received(), file, fps)

    def __enter__(self) -> "BackgroundMovie":
        return self

    def __exit__(self, *error: Any) -> None:
        self._put(_AbandonedError())  # after `finish`, nobody reads it
        self._pool.shutdown()

    def add(self, frame: Frame) -> None:
        """Append a frame; waits while the encoder is far behind."""
        self._put(frame)

    def finish(self) -> tuple[str, ...]:
        """Wait until the file is complete; returns what differs from the frames, in words.

        Raises:
            as ``write_movie``.
        """
        self._put(None)
        return self._written.result()

    def _put(self, item: Frame | _AbandonedError | None) -> None:
        """An encoder that has ended takes nothing, and ``finish`` says why it did."""
        while not self._written.done():
            try:
                self._frames.put(item, timeout=_POLL_S)
            except Full:
                continue
            return

    def _received(self) -> Iterator[Frame]:
        while (frame := self._frames.get()) is not None:
            if isinstance(frame, _AbandonedError):
                raise frame
            yield frame
