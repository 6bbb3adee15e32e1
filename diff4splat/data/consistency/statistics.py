"""Summary statistics of errors."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """Statistics of errors; never NaN."""

    max: float
    median: float
    count: int
    """Number of comparisons, at least 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueFraction:
    """Fraction of comparisons that agree."""

    share: float
    """0 to 1."""
    count: int


def error_statistics(errors: Iterable[Float[Tensor, " _"]]) -> ErrorStatistics | None:
    """Maximum and lower median; NaN counts as infinite."""
    together = torch.cat([torch.zeros(0, dtype=torch.float64), *errors])
    if not len(together):
        return None
    together = torch.nan_to_num(together, nan=torch.inf, posinf=torch.inf)
    worst, middle = float(together.max()), float(together.median())
    return ErrorStatistics(max=worst, median=middle, count=len(together))


def true_fraction(agrees: Iterable[Bool[Tensor, " _"]]) -> TrueFraction | None:
    """Fraction of True values."""
    together = torch.cat([torch.zeros(0, dtype=torch.bool), *agrees])
    if not len(together):
        return None
    return TrueFraction(share=float(together.double().mean()), count=len(together))
