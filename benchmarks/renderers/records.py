"""What is measured, as plain values that travel between processes and into JSON.

Seconds and bytes. ``forward`` is one image without gradients; ``both`` is one image with
gradients recorded and the backward pass.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Literal

Kind = Literal["forward", "both"]
KINDS: tuple[Kind, ...] = ("forward", "both")


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Windows of one kind of call; a window is as many calls as fill it, at least one."""

    best_s: float
    median_s: float
    windows: int
    first_s: float
    """The first call on the scene, after a warm-up on a tiny one."""
    peak_bytes: int
    """Growth of resident memory during the first call, above the prepared scene."""


def timing(windows_s: Sequence[float], first_s: float, peak_bytes: int) -> Timing:
    """Summary of the windows; the first call stands in where nothing else was measured."""
    used = windows_s or [first_s]
    return Timing(
        best_s=min(used),
        median_s=median(used),
        windows=len(used),
        first_s=first_s,
        peak_bytes=peak_bytes,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageError:
    """An image against the truth at the sampled pixels."""

    psnr_db: float
    """Peak 1, over the sample; infinite for equal images."""
    max_error: float
    wrong: int
    """Pixels with a channel off by more than half a level of 255."""
    bias: float
    """Mean of ours minus truth."""
    doubtful: int
    """Pixels where an alpha lies so close to the cutoff that rounding may decide."""
    sampled: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientError:
    """A gradient against the truth, one parameter; None where the true gradient vanishes."""

    parameter: str
    relative_l2: float | None
    cosine: float | None
    bias: float | None
    """Σ (a - b) / Σ |b|."""
    worst: float | None
    """max |a - b| / (atol + rtol |b|): up to 1, every element is within the bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One renderer on one scene with one number of threads."""

    peer: str
    scene: str
    threads: int
    reason: str = ""
    """Why something was not measured."""
    note: str = ""
    judged: bool = True
    others_cores: float = 0.0
    """Cores that other programs kept busy meanwhile, on average; 0 where that is not known."""
    forward: Timing | None = None
    both: Timing | None = None
    image: ImageError | None = None
    gradients: tuple[GradientError, ...] = ()

    def timing(self, kind: Kind) -> Timing | None:
        """The timing of one kind of call."""
        return self.forward if kind == "forward" else self.both


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """How much there is to do in a scene, whoever does it."""

    scene: str
    gaussians: int
    pixels: int
    blended_pairs: float = math.nan
    reason: str = ""
    """Why the truth could not be found."""


def plain(record: object) -> object:
    """``record`` as JSON takes it: numbers that are not finite become None."""
    if isinstance(record, float):
        return record if math.isfinite(record) else None
    if isinstance(record, dict):
        return {key: plain(value) for key, value in record.items()}
    if isinstance(record, list | tuple):
        return [plain(value) for value in record]
    if hasattr(record, "__dataclass_fields__"):
        return plain(asdict(record))
    return record
