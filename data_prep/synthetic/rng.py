"""Random numbers that are equal on every machine.

NumPy guarantees the raw integers of a bit generator, but not the output of its distributions. This
module therefore converts raw Philox integers by exact arithmetic. (x >> 11) · 2⁻⁵³ is uniform on
[0, 1). The normal distribution is the integer sum of twelve uniform 32-bit numbers (Irwin–Hall).
"""

import hashlib
import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from jaxtyping import Float64

_Item = TypeVar("_Item")


class Rng:
    """A random stream, seeded by a path of words and integers."""

    def __init__(self, *path: int | str) -> None:
        digest = hashlib.blake2b(repr(path).encode(), digest_size=16).digest()
        self._path = path
        self._bits = np.random.Philox(key=int.from_bytes(digest, "little"))

    def child(self, *path: int | str) -> "Rng":
        """An independent stream; it does not depend on the numbers already drawn here."""
        return Rng(*self._path, *path)

    def unit(self, *shape: int) -> Float64[np.ndarray, "..."]:
        """Uniform on [0, 1)."""
        raw = self._bits.random_raw(int(np.prod(shape, dtype=np.int64)))
        return (np.asarray(raw, dtype=np.uint64) >> np.uint64(11)).reshape(shape) * 2.0**-53

    def uniform_array(self, low: float, high: float, *shape: int) -> Float64[np.ndarray, "..."]:
        """Uniform on [low, high)."""
        return low + (high - low) * self.unit(*shape)

    def uniform(self, low: float, high: float) -> float:
        """One number, uniform on [low, high)."""
        return low + (high - low) * float(self.unit(1)[0])

    def log_uniform(self, low: float, high: float) -> float:
        """One number of [low, high), uniform by its logarithm."""
        return math.exp(self.uniform(math.log(low), math.log(high)))

    def integer(self, low: int, high: int) -> int:
        """One integer from low to high, both included."""
        return low + int(float(self.unit(1)[0]) * (high - low + 1))

    def bernoulli(self, share: float) -> bool:
        """True with probability ``share``."""
        return float(self.unit(1)[0]) < share

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.bernoulli(0.5) else -1.0

    def choice(self, items: Sequence[_Item]) -> _Item:
        """One item, all equally likely."""
        return items[self.integer(0, len(items) - 1)]

    def weighted_choice(self, items: Sequence[_Item], weights: Sequence[float]) -> _Item:
        """One item, with a probability proportional to its weight."""
        position = float(self.unit(1)[0]) * sum(weights)
        for item, weight in zip(items, weights, strict=True):
            position -= weight
            if position < 0:
                return item
        return items[-1]

    def permuted(self, items: Sequence[_Item]) -> list[_Item]:
        """All items in random order."""
        return [items[i] for i in np.argsort(self.unit(len(items)), kind="stable")]

    def normal(self, *shape: int) -> Float64[np.ndarray, "..."]:
        """Mean 0, standard deviation 1, within ±6."""
        raw = np.asarray(self._bits.random_raw(12 * int(np.prod(shape, dtype=np.int64))))
        total = (raw.astype(np.uint64) >> np.uint64(32)).reshape(*shape, 12).sum(-1)
        return total * 2.0**-32 - 6.0

    def random_seed(self) -> int:
        """A 32-bit seed for another generator."""
        return int(self._bits.random_raw()) >> 32
