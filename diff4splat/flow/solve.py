"""A named solver: fixed levels, the step size ``adaptive``, or weights ``fitted`` to a network."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.flow.adaptive import StepControl, integrate_adaptively
from diff4splat.flow.fitted import FittedSteps, integrate_fitted
from diff4splat.flow.sampler_types import VelocityFn
from diff4splat.flow.samplers import SAMPLERS, find_sampler, integrate

ADAPTIVE, FITTED = "adaptive", "fitted"
SOLVERS = (*SAMPLERS, ADAPTIVE, FITTED)
FIXED_DEFAULT = "multistep2"
"""Where an adaptive step size has nothing to decide about, and where nothing is fitted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverPath:
    """Settings of every kind of solver; each reads its own."""

    levels: Sequence[float]
    control: StepControl
    fitted: FittedSteps | None = None


def solve(
    name: str,
    velocity: VelocityFn,
    start: Tensor,
    path: SolverPath,
    advance: Callable[[], None] | None = None,
) -> Tensor:
    """Carry noise to data by the solver ``name``.

    Raises:
        ConfigError: no such solver, levels that do not decrease, or nothing fitted.
        ShapeError: as ``integrate``.
    """
    if name == ADAPTIVE:
        return integrate_adaptively(velocity, start, path.control, advance).state
    if name == FITTED:
        if path.fitted is None:
            raise ConfigError("sampler fitted: expected fitted steps, got none")
        return integrate_fitted(velocity, start, path.fitted, advance)
    return integrate(find_sampler(name), velocity, start, path.levels, advance)


def require_solver(name: str) -> str:
    """Return ``name`` when it is a solver.

    Raises:
        ConfigError: it is not.
    """
    if name not in SOLVERS:
        raise ConfigError(f"sampler: expected one of {', '.join(SOLVERS)}, got {name!r}")
    return name
