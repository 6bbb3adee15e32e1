"""Rates from measured runs: non-negative least squares of relative errors.

Axes: ``r`` runs, ``n`` names of amounts.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from diff4splat.outputs.budgets.costs import Work

SWEEPS = 5000
RIDGE = 1e-6
"""Decides between amounts that grow alike in all runs."""


def fit_rates(work: Sequence[Work], measured: Sequence[float | int]) -> dict[str, float]:
    """A rate of at least 0 for each amount, so that Σ rate · amount is near what was measured.

    Each run counts by its relative error. Coordinate descent on the normal equations.
    """
    names = sorted({name for one in work for name, amount in one.items() if amount > 0})
    target = np.maximum(np.array(measured, float), 1e-9)
    table = np.array([[one.get(name, 0.0) for name in names] for one in work], float)
    table /= target[:, None]
    scale = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    solution = _non_negative(table / scale, np.ones(len(work)))
    return dict(zip(names, (solution / scale).tolist(), strict=True))


def _non_negative(table: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Minimises |table · x − target|² + RIDGE · |x|² over x of at least 0."""
    gram = table.T @ table + RIDGE * np.eye(table.shape[1])
    wanted, found = table.T @ target, np.zeros(table.shape[1])
    for _ in range(SWEEPS):
        before = found.copy()
        for k in range(len(found)):
            found[k] = max(found[k] + (wanted[k] - gram[k] @ found) / gram[k, k], 0.0)
        if np.abs(found - before).max(initial=0) < 1e-12:
            break
    return found
