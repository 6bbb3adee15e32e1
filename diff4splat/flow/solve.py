"""A named solver: fixed levels, or an adaptive step size under the name ``adaptive``."""

from collections.abc import Callable, Sequence

from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.flow.adaptive import StepControl, integrate_adaptively
from diff4splat.flow.sampler_types import VelocityFn
from diff4splat.flow.samplers import SAMPLERS, find_sampler, integrate

ADAPTIVE = "adaptive"
SOLVERS = (*SAMPLERS, ADAPTIVE)
FIXED_DEFAULT = "multistep2"
"""Of what an adaptive step size has nothing to decide about."""


def solve(
    name: str,
    velocity: VelocityFn,
    start: Tensor,
    path: tuple[Sequence[float], StepControl],
    advance: Callable[[], None] | None = None,
) -> Tensor:
    """Carry noise to data by the solver ``name``; ``path`` holds the levels and the tolerance.

    Raises:
        ConfigError: no such solver, or levels that do not decrease.
        ShapeError: as ``integrate``.
    """
    levels, control = path
    if name == ADAPTIVE:
        return integrate_adaptively(velocity, start, control, advance).state
    return integrate(find_sampler(name), velocity, start, levels, advance)


def require_solver(name: str) -> str:
    """Return ``name`` when it is a solver.

    Raises:
        ConfigError: it is not.
    """
    if name not in SOLVERS:
        raise ConfigError(f"sampler: expected one of {', '.join(SOLVERS)}, got {name!r}")
    return name
