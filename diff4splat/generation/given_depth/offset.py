"""Where infinity is in inverse depth that is known up to a factor and an offset."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset:
    """The value of the map at infinity."""

    infinity: float
    why: str


def find_offset(values: np.ndarray, reference: np.ndarray | None) -> Offset:
    known = values[np.isfinite(values)]
    low, mid = np.quantile(known, [0.01, 0.5])
    return Offset(infinity=float(low - (mid - low) / 7), why="near and far")
