"""One item of work, done and left out: what that costs, and how far the results differ."""

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from torch import Tensor

Frames = Sequence[Tensor]
"""RGB ``h w 3`` each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """Work that may be left out of one input."""

    name: str
    full: Callable[[], Frames]
    """Frames with the work done."""
    lean: Callable[[], Frames]
    """The same without it."""
    saved_bytes: float | int
    """Of weights that are not read, or of tensors that are not made."""
    compared: Callable[[], Frames] | None = None
    """Frames to compare with, where the work makes another scene that is then not used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """One item on one input."""

    item: str
    source: str
    """Name of the input."""
    full_s: float
    """Processor seconds."""
    lean_s: float
    saved_bytes: float | int
    error: float
    """Largest difference of RGB in [0, 1]; 0 is bit-identical."""
    mean_square: float

    @property
    def psnr_db(self) -> float:
        """Infinite where the frames are identical."""
        return math.inf if self.mean_square == 0 else -10 * math.log10(self.mean_square)


def measure(item: Item, source: str, repeats: int = 2) -> Measured:
    """Both ways in turn, the faster run of each; the first of each warms up."""
    full, lean = (item.compared or item.full)(), item.lean()
    seconds: dict[str, list[float]] = {"full": [], "lean": []}
    for _ in range(repeats):
        for name, work in (("full", item.full), ("lean", item.lean)):
            began = time.process_time()
            work()
            seconds[name].append(time.process_time() - began)
    differences = [(one - other).double() for one, other in zip(full, lean, strict=True)]
    return Measured(
        item=item.name,
        source=source,
        full_s=min(seconds["full"]),
        lean_s=min(seconds["lean"]),
        saved_bytes=item.saved_bytes,
        error=max(float(one.abs().max()) for one in differences),
        mean_square=statistics.fmean(float(one.square().mean()) for one in differences),
    )
