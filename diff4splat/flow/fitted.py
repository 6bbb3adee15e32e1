"""A sampler whose coefficients are fitted to exact trajectories of one network.

Axes: ``b`` batch, ``*d`` everything else. After the evaluations at levels l_0 = 1 > … > l_k, with
their clean predictions D_0 … D_k, the next state is

    state_k+1 = l_k+1 · noise + (1 - l_k+1) Σ_j w_kj D_j        Σ_j w_kj = 1

Every multistep method with a corrector has this form. Its weights follow from a smooth D; here they
are the least squares solution for the states of an exact trajectory, one row after the other, each
on the states that the rows before it lead to (bespoke non-stationary solvers, Shaul et al., arXiv
2403.01329, fit by gradients). That pays where D is rough in the level: many predictions average it.
A row that sums to 1 keeps straight paths and data in one point exact, whatever was fitted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.flow.checked_velocity import checked, solver_state
from diff4splat.flow.levels import require_levels
from diff4splat.flow.path import clean_from_velocity
from diff4splat.flow.sampler_types import VelocityFn

RIDGE = 1e-4
"""Of the mean square of a difference of predictions: alike ones share their weight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedSteps:
    """Levels of the evaluations, the first of them 1, and one row of weights for each."""

    levels: tuple[float, ...]
    weights: tuple[tuple[float, ...], ...]
    """Row k weighs the predictions 0 to k."""

    def __post_init__(self) -> None:
        require_levels((*self.levels, 0.0))
        lengths = [len(row) for row in self.weights]
        if lengths != list(range(1, len(self.levels) + 1)):
            raise ConfigError(
                f"fitted steps: expected rows of 1 to {len(self.levels)} weights, got {lengths}"
            )
        sums = [sum(row) for row in self.weights]
        if not all(abs(total - 1) < 1e-9 for total in sums):
            raise ConfigError(f"fitted steps: expected rows that sum to 1, got {sums}")


def integrate_fitted(
    velocity: VelocityFn,
    start: Float[Tensor, "b *d"],
    steps: FittedSteps,
    advance: Callable[[], None] | None = None,
) -> Float[Tensor, "b *d"]:
    """Carry ``start`` from level 1 to level 0; one evaluation per row.

    Raises:
        ShapeError: ``start`` is not floating point, or ``velocity`` answers in another shape.
    """
    noise, velocity = solver_state(start), checked(velocity)
    state, clean = noise, []
    following = (*steps.levels[1:], 0.0)
    for level, next_level, row in zip(steps.levels, following, steps.weights, strict=True):
        clean.append(clean_from_velocity(state, velocity(state, level), level))
        state = _state(noise, clean, row, next_level)
        if advance is not None:
            advance()
    return state


def fit_steps(
    velocity: VelocityFn,
    start: Float[Tensor, "b *d"],
    levels: Sequence[float],
    exact: Callable[[float], Float[Tensor, "b *d"]],
    use: Callable[[Tensor], Tensor] = lambda states: states,
) -> FittedSteps:
    """Rows that lead nearest to ``exact(level)``; ``levels`` are without the final 0.

    ``use`` picks what of the states counts.
    """
    noise, velocity = solver_state(start), checked(velocity)
    state, clean, rows = noise, [], []
    for level, next_level in zip(levels, (*levels[1:], 0.0), strict=True):
        clean.append(clean_from_velocity(state, velocity(state, level), level))
        mean = (exact(next_level) - next_level * noise) / (1 - next_level)
        rows.append(_row([use(one) for one in clean], use(mean)))
        state = _state(noise, clean, rows[-1], next_level)
    return FittedSteps(levels=tuple(levels), weights=tuple(rows))


def _state(noise: Tensor, clean: list[Tensor], row: Sequence[float], level: float) -> Tensor:
    mean = sum(weight * one for weight, one in zip(row, clean, strict=True))
    return level * noise + (1 - level) * mean


def _row(clean: list[Tensor], mean: Tensor) -> tuple[float, ...]:
    """Least squares weights, of sum 1, of predictions for ``mean``."""
    *others, last = (one.flatten().double() for one in clean)
    if not others:
        return (1.0,)
    differences = torch.stack([one - last for one in others], 1)
    squares = differences.T @ differences
    ridge = RIDGE * squares.diagonal().mean().clamp_min(torch.finfo(torch.float64).tiny)
    squares = squares + ridge * torch.eye(len(others), dtype=torch.float64)
    weights = torch.linalg.solve(squares, differences.T @ (mean.flatten().double() - last))
    return (*weights.tolist(), 1 - float(weights.sum()))
