"""The exact step of the sampling equation for a clean prediction that is linear in the level.

d state / d level = (state - clean(level)) / level
state_b = b/a state_a + (1 - b/a) clean_a + slope (b ln(a/b) - a + b)
"""

import math

from torch import Tensor


def follow(state: Tensor, pair: tuple[float, float], clean: Tensor, slope: Tensor) -> Tensor:
    """Exact step when the clean prediction is ``clean`` + ``slope`` · (level - first level)."""
    level, next_level = pair
    kept = next_level / level
    return kept * state + (1 - kept) * clean + bend(pair) * slope


def bend(pair: tuple[float, float]) -> float:
    """What a slope of 1 adds; it is -a into level 0."""
    level, next_level = pair
    if next_level == 0:
        return -level
    return next_level * math.log(level / next_level) - level + next_level
