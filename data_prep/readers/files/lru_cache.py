"""A least-recently-used cache with a memory limit."""

from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock

import numpy as np


class LruCache:
    """Arrays by key, at most ``max_bytes`` in total; thread-safe."""

    def __init__(self, max_bytes: int) -> None:
        self._most_bytes = max_bytes
        self._bytes = 0
        self._arrays: OrderedDict[Hashable, tuple[np.ndarray, ...]] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable) -> tuple[np.ndarray, ...] | None:
        """The cached arrays; None if absent."""
        with self._lock:
            arrays = self._arrays.get(key)
            if arrays is not None:
                self._arrays.move_to_end(key)
            return arrays

    def put(self, key: Hashable, arrays: tuple[np.ndarray, ...]) -> None:
        """Cache ``arrays`` and evict the least recently used ones beyond the limit."""
        with self._lock:
            self._bytes += _size(arrays) - _size(self._arrays.pop(key, ()))
            self._arrays[key] = arrays
            while self._bytes > self._most_bytes and self._arrays:
                self._bytes -= _size(self._arrays.popitem(last=False)[1])


def _size(arrays: tuple[np.ndarray, ...]) -> int:
    return sum(array.nbytes for array in arrays)
