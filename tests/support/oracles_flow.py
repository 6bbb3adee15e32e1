"""Flows with known answers, in float64 and written from the formulas.

``level`` runs from 1 (noise) to 0 (data).
"""

import math

import numpy as np
import torch
from torch import Tensor


def decay(state: Tensor, level: float) -> Tensor:
    """d state / d level = -state cos(level)."""
    return -state * math.cos(level)


def decay_solution(start: Tensor, first: float, last: float) -> Tensor:
    return start * math.exp(math.sin(first) - math.sin(last))


def square(state: Tensor, level: float) -> Tensor:
    """d state / d level = state² (1 + level): nonlinear, and explicit in the level."""
    return state**2 * (1 + level)


def square_solution(start: Tensor, first: float, last: float) -> Tensor:
    def area(level: float) -> float:
        return level + level**2 / 2

    return 1 / (1 / start + area(first) - area(last))


def gaussian_trajectory(mean: float, std: float, normal: Tensor, level: float) -> Tensor:
    """Where the flow of N(mean, std²) data carries the noise ``normal``."""
    variance = (1 - level) ** 2 * std**2 + level**2
    return (1 - level) * mean + math.sqrt(variance) * normal


def linear_clean(slope: Tensor, base: Tensor):
    """Velocity of a flow whose clean prediction is base + slope · level at any state."""

    def velocity(state: Tensor, level: float) -> Tensor:
        return (state - base - slope * level) / level

    return velocity


def linear_clean_solution(start: Tensor, slope: Tensor, base: Tensor, last: float) -> Tensor:
    """From level 1: state = base + C level - slope level ln(level), with C from the start."""
    return base + (start - base) * last - slope * last * math.log(last)


def mixture_velocity(
    noisy: float, level: float, means: list[float], stds: list[float], weights: list[float]
) -> float:
    """E[noise - clean | noisy] in one dimension, by quadrature over clean values."""
    low = min(m - 12 * s for m, s in zip(means, stds, strict=True))
    high = max(m + 12 * s for m, s in zip(means, stds, strict=True))
    clean = np.linspace(low, high, 400_001)
    prior = sum(
        w / s * np.exp(-0.5 * ((clean - m) / s) ** 2)
        for m, s, w in zip(means, stds, weights, strict=True)
    )
    noise = (noisy - (1 - level) * clean) / level
    share = prior * np.exp(-0.5 * noise**2)
    return float((share * (noise - clean)).sum() / share.sum())


def slope_of(errors: list[float], steps: list[int]) -> float:
    """Order of convergence: minus the slope of log error over log steps."""
    return -float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def seeded_normal(*shape: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)
