"""Mean velocity of a flow over a segment of levels: what a step of a student has to predict.

Axes: ``b`` batch, ``*d`` everything else. From ``level`` down to ``end`` a velocity field v carries
a state x, and one Euler step of length level − end gets as far with

    u = 1 / (level − end) ∫ v(x(l), l) dl = (x(level) − x(end)) / (level − end)

(the average velocity of MeanFlow, arXiv 2505.13447, equation 3, with ends that are fixed: the next
step's level). Here the integral is that of n Euler steps, so u is the mean of their velocities:
nothing is divided by a length that tends to 0, where u is the velocity itself.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError

Velocity = Callable[[Float[Tensor, "b *d"], Float[Tensor, " b"]], Float[Tensor, "b *d"]]
"""Of a state at one level per sample."""


def mean_velocity(
    velocity: Velocity,
    state: Float[Tensor, "b *d"],
    level: Float[Tensor, " b"],
    end: Float[Tensor, " b"],
    steps: int,
) -> Float[Tensor, "b *d"]:
    """Mean velocity from ``level`` to ``end`` by so many Euler steps.

    Raises:
        ConfigError: less than one step.
    """
    if steps < 1:
        raise ConfigError(f"mean velocity: expected at least 1 step, got {steps}")
    step = (level - end) / steps
    wide = step.view(-1, *(1,) * (state.ndim - 1))
    total = torch.zeros_like(state)
    for number in range(steps):
        found = velocity(state, level - number * step)
        total = total + found
        state = state - wide * found
    return total / steps


def segment_of(
    uniform: Float[Tensor, " b"], segments: int
) -> tuple[Float[Tensor, " b"], Float[Tensor, " b"]]:
    """Start and end of one of ``segments`` equal parts of the levels, for numbers in [0, 1)."""
    number = (uniform * segments).floor().clamp(0, segments - 1)
    return (number + 1) / segments, number / segments
