"""DPM-Solver++(2M) and UniPC: multistep samplers in the log signal-to-noise ratio.

With λ = log((1 - level) / level), a = level, b = next level, L = λ_b - λ_a and the clean prediction
D = state - a · velocity, the sampling equation is solved exactly where D is known over λ:

    state_b = b/a state_a + (1 - b) ∫₀ᴸ exp(u - L) D(λ_a + u) du

    dpmpp2m   D from the last two predictions: D_a + (D_a - D_before) L / (2 L_before)
              (DPM-Solver++, Lu et al., arXiv 2211.01095)
    unipc     the same predictor. When the prediction at b is known, the step from a to b is
              repeated with it: no further call (UniPC-2, B(h) = exp(h) - 1, Zhao et al.,
              arXiv 2302.04867)

λ is infinite at both ends. A prediction at level 1 is infinitely far from all others and gets no
weight; a step into level 0 gives D itself. Both are what the formulas tend to, so that no level is
moved. The corrector of the step out of level 1 takes D linear in the level, as ``multistep2``.
λ, its differences and exp are Python floats: they lose their digits in half precision.
"""

import math

from torch import Tensor

from diff4splat.flow.linear_clean import follow
from diff4splat.flow.path import clean_from_velocity
from diff4splat.flow.sampler_types import Memory, VelocityFn

Pair = tuple[float, float]


def dpmpp2m_step(
    velocity: VelocityFn, state: Tensor, pair: Pair, memory: Memory | None
) -> tuple[Tensor, Memory | None]:
    """DPM-Solver++(2M): one call."""
    clean = clean_from_velocity(state, velocity(state, pair[0]), pair[0])
    known = Memory(state=state, level=pair[0], clean=clean)
    return _predict(known, pair[1], memory), known


def unipc_step(
    velocity: VelocityFn, state: Tensor, pair: Pair, memory: Memory | None
) -> tuple[Tensor, Memory | None]:
    """UniPC of order 2: one call, and a correction of the step before."""
    clean = clean_from_velocity(state, velocity(state, pair[0]), pair[0])
    if memory is not None:
        state = _correct(memory, pair[0], clean)
    known = Memory(state=state, level=pair[0], clean=clean, before=_without_before(memory))
    return _predict(known, pair[1], memory), known


def log_snr(level: float) -> float:
    """log((1 - level) / level); infinite at levels 0 and 1."""
    if level in (0.0, 1.0):
        return math.copysign(math.inf, 0.5 - level)
    return math.log1p(-level) - math.log(level)


def _predict(known: Memory, next_level: float, before: Memory | None) -> Tensor:
    level = known.level
    if next_level == 0:
        return known.clean
    clean = known.clean
    if before is not None:
        share = 0.5 / _ratio(before.level, level, next_level)
        clean = clean + share * (clean - before.clean)
    return _exponential_step(known, next_level, clean)


def _correct(start: Memory, level: float, clean: Tensor) -> Tensor:
    """The step from ``start`` to ``level`` again, where the prediction is now ``clean``."""
    change = clean - start.clean
    if start.level == 1:
        return follow(start.state, (1.0, level), start.clean, change / (level - 1))
    before = start.before
    earlier, later = (
        (0.0, 0.5) if before is None else _corrector_weights(before.level, start, level)
    )
    mixed = start.clean + later * change
    if before is not None and earlier:
        mixed = mixed + earlier * (before.clean - start.clean)
    return _exponential_step(start, level, mixed)


def _corrector_weights(before_level: float, start: Memory, level: float) -> tuple[float, float]:
    """Weights of the differences to the prediction before and after, as in UniC-2."""
    ratio = _ratio(before_level, start.level, level)
    if math.isinf(ratio):
        return 0.0, 0.5
    # Moments of the quadratic through three predictions: [1/r 1; 1 1] of (-r, 1) in units of L.
    first, second = _moments(log_snr(level) - log_snr(start.level))
    earlier = (second - first) / (ratio * (ratio + 1))
    later = (ratio * first + second) / (ratio + 1)
    return earlier, later


def _moments(step: float) -> tuple[float, float]:
    """Means of u/L and (u/L)² over the step, weighted by exp(u)."""
    if step < 1e-3:  # series: the closed form cancels
        return 0.5 + step / 12, 1 / 3 + step / 12
    scale = -math.expm1(-step)
    first = 1 / scale - 1 / step
    return first, 1 / scale - 2 * first / step


def _exponential_step(start: Memory, level: float, clean: Tensor) -> Tensor:
    """The exact step for one clean prediction: b/a state + (1 - b) (1 - exp(-L)) clean."""
    kept = level / start.level
    return kept * start.state + (1 - kept) * clean


def _ratio(before: float, level: float, next_level: float) -> float:
    """The step before over this one, in λ."""
    return (log_snr(level) - log_snr(before)) / (log_snr(next_level) - log_snr(level))


def _without_before(memory: Memory | None) -> Memory | None:
    if memory is None:
        return None
    return Memory(state=memory.state, level=memory.level, clean=memory.clean)
