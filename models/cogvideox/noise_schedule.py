"""CogVideoX's noise schedule on the straight path of our samplers, exactly.

Its networks see x = α clean + σ noise with α² + σ² = 1 and predict v = α noise − σ clean. With the
level σ / (α + σ), and r = √((1 − level)² + level²) = 1 / (α + σ),

    x        = noisy / r                                  noisy = (1 − level) clean + level noise
    velocity = ((2 level − 1) x + v) / r                  = noise − clean
    v        = r velocity − (2 level − 1) x

All of them are finite for levels in [0, 1]. Only the step, 0 to 999, that the network is told needs
the schedule: it is interpolated between the levels of the steps.
"""

import math
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.joint import JointConfig

STEPS = 1000
MOST_BETA = 0.999
"""Of the cosine schedule (arXiv 2102.09672)."""


@lru_cache(maxsize=8)
def trained_levels(config: JointConfig) -> np.ndarray:
    """Level of each of the 1000 steps, rising, in float64; the last is 1 with zero terminal SNR."""
    share = np.cumprod(1 - _betas(config))
    share = share / (config.snr_shift + (1 - config.snr_shift) * share)
    alpha = np.sqrt(share)
    if config.zero_terminal_snr:
        alpha = (alpha - alpha[-1]) * (alpha[0] / (alpha[0] - alpha[-1]))
    sigma = np.sqrt(1 - alpha**2)
    return sigma / (alpha + sigma)


def _betas(config: JointConfig) -> np.ndarray:
    first, last = config.first_beta, config.last_beta
    if config.betas == "linear":
        return np.linspace(first, last, STEPS)
    if config.betas == "scaled_linear":
        return np.linspace(math.sqrt(first), math.sqrt(last), STEPS) ** 2
    kept = np.cos((np.arange(STEPS + 1) / STEPS + 0.008) / 1.008 * math.pi / 2) ** 2
    return np.minimum(1 - kept[1:] / kept[:-1], MOST_BETA)


def step_of_level(level: Float[Tensor, "*b"], config: JointConfig) -> Float[Tensor, "*b"]:
    """The step in [0, 999] that a network is told; levels below the first step's count as it."""
    table = torch.from_numpy(trained_levels(config)).to(level.device)
    wide = level.double()
    upper = torch.searchsorted(table, wide).clamp(1, STEPS - 1)
    low, high = table[upper - 1], table[upper]
    return upper - 1 + ((wide - low) / (high - low)).clamp(0, 1)


def path_norm(level: Float[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """The r of the formulas."""
    return torch.hypot(1 - level, level)


def velocity_from_v(
    noisy: Float[Tensor, "*b"], v: Float[Tensor, "*b"], level: Float[Tensor, "*#b"]
) -> Float[Tensor, "*b"]:
    """Velocity noise − clean at a point of the straight path."""
    norm = path_norm(level)
    return ((2 * level - 1) * (noisy / norm) + v) / norm


def v_from_velocity(
    noisy: Float[Tensor, "*b"], velocity: Float[Tensor, "*b"], level: Float[Tensor, "*#b"]
) -> Float[Tensor, "*b"]:
    """The way back."""
    norm = path_norm(level)
    return norm * velocity - (2 * level - 1) * (noisy / norm)
