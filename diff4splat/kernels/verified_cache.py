"""Numba's files of compiled kernels, each with a digest beside it: damaged ones count as missing.

A cut off or altered file would end in a traceback, or in machine code that nobody wrote.
"""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from numba.core.caching import IndexDataCacheFile


class VerifiedCacheFile(IndexDataCacheFile):
    """The index of a kernel and its machine code on disk."""

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[IO[bytes]]:
        with super()._open_for_write(filepath) as stream:
            yield stream
        digest_file(filepath).write_text(_digest(filepath))

    def _load_index(self) -> dict[Any, str]:
        return super()._load_index() if is_intact(self._index_path) else {}

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        if not is_intact(path):
            # Numba takes this for a file that was removed, and compiles.
            raise OSError(f"{path}: expected a compiled kernel, got a damaged file")
        return super()._load_data(name)


def is_intact(path: str) -> bool:
    """Whether the file is as it was written."""
    try:
        return digest_file(path).read_bytes() == _digest(path).encode()
    except OSError:
        return False


def digest_file(path: str) -> Path:
    """Where the digest of a file lies."""
    return Path(f"{path}.sha256")


def _digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
