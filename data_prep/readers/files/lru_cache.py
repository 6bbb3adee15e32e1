"""A store that forgets what was not used for longest when it grows too large."""

from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock

import numpy as np


class LruCache:
    """Arrays by key, of at most ``max_bytes`` together; safe between threads."""

    def __init__(self, max_bytes: int) -> None:
        self._most_bytes = max_bytes
        self._bytes = 0
        self._arrays: OrderedDict[Hashable, tuple[np.ndarray, ...]] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable) -> tuple[np.ndarray, ...] | None:
        """What was put there, if it is still known."""
        with self._lock:
            found = self._arrays.get(key)
            if found is not None:
                self._arrays.move_to_end(key)
            return found

    def put(self, key: Hashable, arrays: tuple[np.ndarray, ...]) -> None:
        """Keep ``arrays`` and forget others where needed."""
        with self._lock:
            self._bytes += _size(arrays) - _size(self._arrays.pop(key, ()))
            self._arrays[key] = arrays
            while self._bytes > self._most_bytes and self._arrays:
                self._bytes -= _size(self._arrays.popitem(last=False)[1])


def _size(arrays: tuple[np.ndarray, ...]) -> int:
    return sum(array.nbytes for array in arrays)
