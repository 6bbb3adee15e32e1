"""Sampling with an adaptive step size: a tolerance in the latent in place of a number of steps.

Axes: ``b`` batch, ``*d`` everything else. Each step from level a to b, with D the clean prediction:

    predict    state_p = exact step for D_a and the slope of the last two predictions
    evaluate   D_b from state_p at b, the one call of the step
    correct    state_c = exact step again, with the slope between D_a and D_b
    estimate   error = RMS(state_c - state_p), largest over the kept axes

The error costs no call (Milne's device, as in UniPC, arXiv 2302.04867): it is that of the predictor
and bounds the corrector's, which goes on. A step above the tolerance is tried again, shorter; the
next step follows from h · 0.8 (tolerance / error)^(1/3). No velocity exists at level 0: the end is
the clean prediction at ``last_level``, or earlier with the slope, where the slope is worth no more
than the tolerance and was measured over a step as long as what is left.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.flow.checked_velocity import checked, solver_state
from diff4splat.flow.linear_clean import bend, follow
from diff4splat.flow.path import clean_from_velocity
from diff4splat.flow.sampler_types import Memory, VelocityFn

FIRST_STEP = 0.05
SAFETY, SHRINK, GROW = 0.8, 0.2, 2.0
"""Share of the step that should just hold the tolerance; limits of a change."""
LARGEST_SHARE = 0.8
"""Of the level that one step covers, where steps may go down to 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepControl:
    """How exact each step must be, and how many calls there may be."""

    tolerance: float = 0.02
    """Largest RMS error of one step, in units of the latent."""
    max_calls: int = 128
    """Of the velocity. Where they run out, steps grow beyond the tolerance."""
    last_level: float = 0.0
    """Steps end there and the clean prediction is taken, as by ``make_levels``."""
    kept_axes: tuple[int, ...] = (0,)
    """The error is the largest over these axes; a mean would hide one bad frame among many."""

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < float("inf"):
            raise ConfigError(
                f"tolerance: expected a finite number above 0, got {self.tolerance:g}"
            )
        if not 0 <= self.last_level < 1:
            raise ConfigError(f"last_level: expected 0 or above and below 1, got {self.last_level}")
        if self.max_calls < 2:
            raise ConfigError(f"max_calls: expected at least 2, got {self.max_calls}")


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSolution:
    """The end point, and how it was reached."""

    state: Float[Tensor, "b *d"]
    levels: tuple[float, ...]
    """Visited, from 1 to 0."""
    calls: int
    rejected: int
    """Steps that were tried again."""
    largest_error: float
    """Of the steps taken; above the tolerance where the calls ran out."""


def integrate_adaptively(
    velocity: VelocityFn,
    start: Float[Tensor, "b *d"],
    control: StepControl,
    advance: Callable[[], None] | None = None,
) -> AdaptiveSolution:
    """Carry ``start`` from level 1 to level 0; ``advance`` is called after each step.

    Raises:
        ShapeError: ``start`` is not floating point, or ``velocity`` answers in another shape.
    """
    run = _Run(checked(velocity), solver_state(start), control)
    while run.level > 0:
        run.step()
        if advance is not None and run.accepted:
            advance()
    return run.solution()


class _Run:
    """One integration: where it is, and what it has measured."""

    def __init__(self, velocity: VelocityFn, state: Tensor, control: StepControl) -> None:
        self.velocity, self.control = velocity, control
        self.level, self.state = 1.0, state
        self.calls, self.rejected, self.largest_error = 0, 0, 0.0
        self.levels, self.accepted = [1.0], True
        self.clean = self._clean(state, 1.0)
        self.memory: Memory | None = None
        self.length = FIRST_STEP

    def step(self) -> None:
        """Try one step; take it if it is exact enough or if the calls run out."""
        left = self.control.max_calls - self.calls
        if left < 1 or self._may_end():
            self._end()
            return
        pair, least = self._pair(left)
        length = pair[0] - pair[1]
        predicted = follow(self.state, pair, self.clean, self._slope(length))
        clean = self._clean(predicted, pair[1])
        corrected = follow(self.state, pair, self.clean, (clean - self.clean) / -length)
        error = self._norm(corrected - predicted)
        self.length = length * self._factor(error)
        self.accepted = error <= self.control.tolerance or length <= least
        if not self.accepted:
            self.rejected += 1
            return
        self.memory = Memory(state=self.state, level=self.level, clean=self.clean)
        self.level, self.state, self.clean = pair[1], corrected, clean
        self.levels.append(self.level)
        self.largest_error = max(self.largest_error, error)

    def solution(self) -> AdaptiveSolution:
        return AdaptiveSolution(
            state=self.state,
            levels=tuple(self.levels),
            calls=self.calls,
            rejected=self.rejected,
            largest_error=self.largest_error,
        )

    def _pair(self, left: int) -> tuple[tuple[float, float], float]:
        """The step to try, and the length from which on it is taken whatever its error."""
        away = self.level - self.control.last_level
        least = away / left
        length = max(self.length, least)
        if self.control.last_level == 0:
            length = min(length, self.level * LARGEST_SHARE)
        to_last = length > away * (1 - 1e-9)
        return (self.level, self.control.last_level if to_last else self.level - length), least

    def _may_end(self) -> bool:
        """At the last level, or where the slope is known well enough and worth little."""
        if self.level <= self.control.last_level:
            return True
        if self.memory is None or self.memory.level - self.level < self.level:
            return False
        return self._end_error() <= self.control.tolerance

    def _end(self) -> None:
        pair, slope = (self.level, 0.0), self._slope(self.level)
        if self.level <= self.control.last_level:
            slope = torch.zeros_like(slope)
        elif self.memory is not None:
            self.largest_error = max(self.largest_error, self._end_error())
        self.state = follow(self.state, pair, self.clean, slope)
        self.level, self.accepted = 0.0, True
        self.levels.append(0.0)

    def _end_error(self) -> float:
        return abs(bend((self.level, 0.0))) * self._norm(self._slope(self.level))

    def _slope(self, length: float) -> Tensor:
        """Of the clean prediction; a longer step extrapolates no further than the last change."""
        if self.memory is None:
            return torch.zeros_like(self.clean)
        last = self.memory.level - self.level
        return (self.memory.clean - self.clean) / max(last, length)

    def _factor(self, error: float) -> float:
        if not error < float("inf"):
            return SHRINK
        # Without a slope the predictor is of order 1, and its error falls with the square.
        power = 1 / 2 if self.memory is None else 1 / 3
        wanted = SAFETY * (self.control.tolerance / max(error, 1e-300)) ** power
        return min(max(wanted, SHRINK), GROW)

    def _clean(self, state: Tensor, level: float) -> Tensor:
        self.calls += 1
        return clean_from_velocity(state, self.velocity(state, level), level)

    def _norm(self, difference: Tensor) -> float:
        if difference.numel() == 0:
            return 0.0
        kept = self.control.kept_axes
        others = tuple(axis for axis in range(difference.ndim) if axis not in kept)
        square = difference.detach().square()
        return float((square.mean(others) if others else square).max().sqrt())
