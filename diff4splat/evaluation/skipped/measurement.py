"""One item of work, done and left out: what that costs, and how far the results differ."""

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from torch import Tensor

Frames = Sequence[Tensor]
"""RGB ``h w 3`` each."""
REPEATS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """Work that may be left out of one input."""

    name: str
    full: Callable[[], Frames]
    """Frames with the work done."""
    lean: Callable[[], Frames]
    """The same without it; items that share the function share its frames and its seconds."""
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


@dataclass(frozen=True, slots=True)
class Timed:
    """Frames, and the processor seconds of the fastest run."""

    frames: Frames
    seconds: float


@dataclass(slots=True)
class Bench:
    """Runs work of one input, each function once however many items share it."""

    source: str
    repeats: int = REPEATS
    clock: Callable[[], float] = time.process_time
    _known: dict[Callable[[], Frames], Timed] = field(default_factory=dict)

    def measure(self, item: Item) -> Measured:
        """Seconds both ways, and the largest and the mean difference of the frames."""
        full, lean = self._timed(item.full), self._timed(item.lean)
        frames = full.frames if item.compared is None else item.compared()
        pairs = zip(frames, lean.frames, strict=True)
        differences = [(one - other).double() for one, other in pairs]
        return Measured(
            item=item.name,
            source=self.source,
            full_s=full.seconds,
            lean_s=lean.seconds,
            saved_bytes=item.saved_bytes,
            error=max(float(one.abs().max()) for one in differences),
            mean_square=statistics.fmean(float(one.square().mean()) for one in differences),
        )

    def _timed(self, work: Callable[[], Frames]) -> Timed:
        """The fastest of the repeats: the first also warms up, and others only make runs slower."""
        if work not in self._known:
            seconds: list[float] = []
            for _ in range(self.repeats):
                began = self.clock()
                frames = work()
                seconds.append(self.clock() - began)
            self._known[work] = Timed(frames, min(seconds))
        return self._known[work]
