"""The error that a new input stays below, from the errors of a few others.

Errors of inputs differ by factors, so their logarithms count. The bound is the upper end of a
one-sided prediction interval of a normal distribution with unknown mean and deviation:

    log bound = m + t · s · √(1 + 1/n)        t the quantile of Student's t with n - 1 degrees

Errors of 0 are exact results; they count as the least of the others.
"""

import math
import statistics
from collections.abc import Sequence

QUANTILES = (6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812)
"""95 % of Student's t with 1, 2 … 10 degrees of freedom; beyond, the last one is used."""


def upper_bound(errors: Sequence[float]) -> float:
    """Below which 19 of 20 new inputs are expected; at least the largest of ``errors``.

    One error alone says nothing of others, and is returned as it is.
    """
    largest = max(errors)
    positive = [error for error in errors if error > 0]
    if len(errors) < 2 or not positive:
        return largest
    logs = [math.log(max(error, min(positive))) for error in errors]
    count = len(logs)
    quantile = QUANTILES[min(count - 1, len(QUANTILES)) - 1]
    width = quantile * statistics.stdev(logs) * math.sqrt(1 + 1 / count)
    return max(largest, math.exp(statistics.fmean(logs) + width))
