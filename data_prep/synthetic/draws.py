"""Random numbers that are the same on every machine.

NumPy promises the raw integers of a bit generator for ever, but not what its distributions make of
them. So only raw Philox integers are used, and turned into numbers here by exact arithmetic:
(x >> 11) · 2⁻⁵³ is uniform on [0, 1); the normal distribution is the sum of twelve uniform 32-bit
numbers (Irwin–Hall), added up as integers, hence in no particular order.
"""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from jaxtyping import Float64

_Item = TypeVar("_Item")


class Draws:
    """A stream of numbers named by a path of words and integers."""

    def __init__(self, *path: int | str) -> None:
        digest = hashlib.blake2b(repr(path).encode(), digest_size=16).digest()
        self._path = path
        self._bits = np.random.Philox(key=int.from_bytes(digest, "little"))

    def child(self, *path: int | str) -> "Draws":
        """A stream of its own: what it gives does not depend on what was drawn here before."""
        return Draws(*self._path, *path)

    def unit(self, *shape: int) -> Float64[np.ndarray, "..."]:
        """Uniform on [0, 1)."""
        raw = self._bits.random_raw(int(np.prod(shape, dtype=np.int64)))
        return (np.asarray(raw, dtype=np.uint64) >> np.uint64(11)).reshape(shape) * 2.0**-53

    def array(self, low: float, high: float, *shape: int) -> Float64[np.ndarray, "..."]:
        """Uniform on [low, high)."""
        return low + (high - low) * self.unit(*shape)

    def between(self, low: float, high: float) -> float:
        """One number, uniform on [low, high)."""
        return low + (high - low) * float(self.unit(1)[0])

    def integer(self, low: int, high: int) -> int:
        """One integer from low to high, both included."""
        return low + int(float(self.unit(1)[0]) * (high - low + 1))

    def chance(self, share: float) -> bool:
        """True in this share of cases."""
        return float(self.unit(1)[0]) < share

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.chance(0.5) else -1.0

    def pick(self, items: Sequence[_Item]) -> _Item:
        """One of them, all equally likely."""
        return items[self.integer(0, len(items) - 1)]

    def weighted(self, items: Sequence[_Item], weights: Sequence[float]) -> _Item:
        """One of them, as likely as its weight says."""
        place = float(self.unit(1)[0]) * sum(weights)
        for item, weight in zip(items, weights, strict=True):
            place -= weight
            if place < 0:
                return item
        return items[-1]

    def shuffled(self, items: Sequence[_Item]) -> list[_Item]:
        """All of them in random order."""
        return [items[i] for i in np.argsort(self.unit(len(items)), kind="stable")]

    def normal(self, *shape: int) -> Float64[np.ndarray, "..."]:
        """Mean 0, deviation 1, never beyond 6."""
        raw = np.asarray(self._bits.random_raw(12 * int(np.prod(shape, dtype=np.int64))))
        total = (raw.astype(np.uint64) >> np.uint64(32)).reshape(*shape, 12).sum(-1)
        return total * 2.0**-32 - 6.0

    def bits(self) -> int:
        """A 32-bit seed for somebody else."""
        return int(self._bits.random_raw()) >> 32
