"""Numba's files of compiled kernels, each with a digest: what is damaged is compiled again.

A cut off or altered file would end in a traceback, or in machine code that nobody wrote.
"""

import hashlib
import pickle
from typing import Any

from numba.core.caching import IndexDataCacheFile

_DIGEST_BYTES = hashlib.sha256().digest_size


class VerifiedCacheFile(IndexDataCacheFile):
    """The index of a kernel and its machine code on disk."""

    def _dump(self, obj: Any) -> bytes:
        content = super()._dump(obj)
        return hashlib.sha256(content).digest() + content

    def _save_index(self, overloads: dict[Any, str]) -> None:
        content = self._dump((self._version, self._source_stamp, overloads))
        with self._open_for_write(self._index_path) as stream:
            stream.write(content)

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, overloads = self._verified(self._index_path)
        except OSError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _load_data(self, name: str) -> Any:
        return self._verified(self._data_path(name))

    def _verified(self, path: str) -> Any:
        """What the file holds.

        Raises:
            OSError: it is missing or damaged, which Numba takes for a file that is not there.
        """
        with open(path, "rb") as stream:
            digest, content = stream.read(_DIGEST_BYTES), stream.read()
        if hashlib.sha256(content).digest() != digest:
            raise OSError(f"{path}: expected a compiled kernel, got a damaged file")
        return pickle.loads(content)
