"""Many errors as a few figures."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """Errors; never NaN."""

    max: float
    median: float
    count: int
    """How many were compared, at least 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueFraction:
    """How many of those compared agree."""

    share: float
    """0 to 1."""
    count: int


def error_statistics(errors: Iterable[Float[Tensor, " _"]]) -> ErrorStatistics | None:
    """Largest and lower median; an error that is not a number counts as infinite."""
    together = torch.cat([torch.zeros(0, dtype=torch.float64), *errors])
    if not len(together):
        return None
    together = torch.nan_to_num(together, nan=torch.inf, posinf=torch.inf)
    worst, middle = float(together.max()), float(together.median())
    return ErrorStatistics(max=worst, median=middle, count=len(together))


def true_fraction(agrees: Iterable[Bool[Tensor, " _"]]) -> TrueFraction | None:
    """How many are True."""
    together = torch.cat([torch.zeros(0, dtype=torch.bool), *agrees])
    if not len(together):
        return None
    return TrueFraction(share=float(together.double().mean()), count=len(together))
