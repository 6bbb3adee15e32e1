"""The door through which readers open files: regular ones alone, of a size that fits.

A pipe waits for ever for somebody to write, a device may never end, and a name that stands in a
file may be longer than any, or hold what no name may.
"""

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from diff4splat.errors import Diff4SplatError, FileFormatError, OutputError

MAX_TEXT_BYTES = 256 << 20
"""Of a text file; honest ones have a few megabytes."""
_LONGEST_NAME = 200
"""Characters of a name in a message."""


def require_file(file: Path, what: str, error: type[Diff4SplatError] = FileFormatError) -> None:
    """Require a readable, non-empty file; ``what`` names the expected kind in errors.

    Raises:
        error: the path does not exist, is a folder or device, is empty, or is not readable.
    """
    if not _read(file, what, error, 1):
        raise error(f"{file}: expected {what}, got an empty file; make or copy it again")


def read_bytes(
    file: Path,
    what: str,
    error: type[Diff4SplatError] = FileFormatError,
    max_bytes: int | None = None,
) -> bytes:
    """The content of a file of at most ``max_bytes``.

    Raises:
        error: as ``require_file``, or it is larger.
    """
    content = _read(file, what, error, -1 if max_bytes is None else max_bytes + 1)
    if not content:
        raise error(f"{file}: expected {what}, got an empty file; make or copy it again")
    if max_bytes is not None and len(content) > max_bytes:
        raise error(
            f"{file}: expected {what} of at most {max_bytes >> 20} MiB, got more; wrong file?"
        )
    return content


def read_text(file: Path, what: str, error: type[Diff4SplatError] = FileFormatError) -> str:
    """The text of a file in UTF-8.

    Raises:
        error: as ``read_bytes``, or it is not UTF-8.
    """
    try:
        return read_bytes(file, what, error, MAX_TEXT_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        raise error(
            f"{file}: expected {what}, which is text in UTF-8, got other data; check the path"
        ) from failure


@contextmanager
def opened_file(
    file: Path, what: str, error: type[Diff4SplatError] = FileFormatError
) -> Iterator[BinaryIO]:
    """The file, open for libraries that read by the lengths that stand in it.

    Raises:
        error: as ``require_file``.
    """
    require_file(file, what, error)
    with _BoundedReader(io.FileIO(file)) as stream:
        yield stream


class _BoundedReader(io.BufferedReader):
    """Takes no memory for bytes that a length promises and the file does not hold."""

    def __init__(self, raw: io.FileIO) -> None:
        super().__init__(raw)
        self._size = os.fstat(raw.fileno()).st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Up to ``size`` bytes."""
        rest = max(self._size - self.tell(), 0)
        return super().read(rest if size is None or size < 0 else min(size, rest))


def is_file(file: Path) -> bool:
    """Whether a regular file is there; a name that no file can have is the name of none."""
    try:
        return file.is_file()
    except (OSError, ValueError):
        return False


def require_writable(file: Path) -> None:
    """Require that lines can be appended: a pipe without a reader would wait for ever.

    Raises:
        OutputError: something else than a regular file has this name.
    """
    if (file.exists() or file.is_symlink()) and not is_file(file):
        raise OutputError(
            f"{file}: expected to write here, but a pipe or a device stands there; remove it"
        )


def _read(file: Path, what: str, error: type[Diff4SplatError], count: int) -> bytes:
    try:
        # A pipe without a writer would block the call that opens it, but for this flag.
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            _require_regular(file, os.fstat(descriptor).st_mode, what, error)
            with os.fdopen(descriptor, "rb", closefd=False) as stream:
                return stream.read(count)
        finally:
            os.close(descriptor)
    except (FileNotFoundError, NotADirectoryError):
        raise error(f"{file}: expected {what}, got no such file; check the path") from None
    except Diff4SplatError:
        raise
    except (OSError, ValueError) as failure:
        reason = getattr(failure, "strerror", None) or "a name that no file can have"
        raise error(
            f"{_shortened(file)}: expected {what}, got '{reason}'; check the path"
        ) from failure


def _require_regular(file: Path, mode: int, what: str, error: type[Diff4SplatError]) -> None:
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a device"
        raise error(f"{file}: expected {what}, got {kind}; give the file itself")


def _shortened(file: Path) -> str:
    """A name of 5,000 characters is no help in a message."""
    name = str(file)
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}…"
