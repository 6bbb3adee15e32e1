"""Noise levels that a sampler visits: Python floats (float64) from 1 (noise) down to 0 (data).

``n`` steps need n + 1 levels. Five rules:

    uniform   level_i = 1 - i / n
    log_snr   log((1 - level) / level) evenly spaced between its values at 1 - edge and edge, with
              edge = EDGE / n, and the two outermost levels then moved to 1 and 0 (the spacing is
              that of DPM-Solver, Lu et al., arXiv 2206.00927)
    last      no level between 0 and ``last``: networks that predict clean latents have no velocity
              that tends to a limit there, so that the end of the flow is where one stops
    pieces    for velocities that jump (guidance): a level at each jump, half of the steps even in
              the level above the lowest one, half towards ``last`` below it
    shift k   level → k · level / (1 + (k - 1) · level), on top of either: k > 1 spends more steps
              on noisy levels (Esser et al., arXiv 2403.03206, §5.3.2)

They stay on the host because 1 / level and logarithms of it lose their digits in half precision.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

from diff4splat.errors import ConfigError

EDGE = 0.16
"""Measured on exact mixture flows: best overall of 0.08 to 0.24, over 6 to 128 steps."""

Schedule = Literal["uniform", "log_snr"]


def make_levels(
    schedule: Schedule, steps: int, shift: float = 1.0, last: float = 0.0
) -> tuple[float, ...]:
    """The levels of a named schedule, none between 0 and ``last``, shifted.

    Raises:
        ConfigError: unknown schedule, fewer than one step, or a shift that is not above 0.
    """
    rules = {"uniform": uniform_levels, "log_snr": log_snr_levels}
    if schedule not in rules:
        raise ConfigError(f"schedule: expected one of {', '.join(rules)}, got {schedule!r}")
    if not 0 <= last < 0.5:
        raise ConfigError(f"last level: expected 0 or above and below 0.5, got {last:g}")
    return shift_levels(rules[schedule](steps, last), shift)


def uniform_levels(steps: int, last: float = 0.0) -> tuple[float, ...]:
    """Evenly spaced from 1 to 0, or to ``last`` and then 0."""
    _require_steps(steps)
    if last * steps <= 1:
        return tuple((steps - i) / steps for i in range(steps + 1))
    return (*(1 - (1 - last) * i / (steps - 1) for i in range(steps)), 0.0)


def log_snr_levels(steps: int, last: float = 0.0) -> tuple[float, ...]:
    """Evenly spaced in log signal-to-noise ratio: small steps at both ends, where flows are stiff.

    The last step starts from level EDGE / steps, or from ``last`` if that is more; for an exact
    field a fixed edge would leave an error that more steps do not remove.
    """
    _require_steps(steps)
    reach = math.log(min(steps / EDGE, 1 / last if last else math.inf) - 1)
    inner = (1 / (1 + math.exp(reach * (2 * i / steps - 1))) for i in range(1, steps))
    return (1.0, *inner, 0.0)


def piecewise_levels(steps: int, jumps: Sequence[float], last: float = 0.0) -> tuple[float, ...]:
    """A level at each of ``jumps``, in falling order; as ``log_snr`` where there is no room.

    Below the lowest jump, logarithms of levels follow the 0.7th power of the step: of 0.5 to 1.4
    the best for the shipped video model.
    """
    _require_steps(steps)
    ends, final = (1.0, *jumps), max(last, EDGE / steps)
    above, below = steps // 2, steps - steps // 2
    if not jumps or above < len(jumps) or below < 2 or final >= ends[-1]:
        return log_snr_levels(steps, last)
    shares = (final / ends[-1], (below - 1) ** 0.7)
    lower = (ends[-1] * shares[0] ** (k**0.7 / shares[1]) for k in range(below))
    return (*_evenly(ends, above), *lower, 0.0)


def _evenly(ends: Sequence[float], steps: int) -> tuple[float, ...]:
    """``steps`` levels from the first of ``ends`` to the last, without that: each at least once."""
    span, levels, left = ends[0] - ends[-1], [], steps
    for number, (high, low) in enumerate(pairwise(ends)):
        others = len(ends) - 2 - number
        count = min(max(round(steps * (high - low) / span), 1), left - others)
        count = left if not others else count
        levels += [high + (low - high) * i / count for i in range(count)]
        left -= count
    return tuple(levels)


def shift_levels(levels: Sequence[float], shift: float) -> tuple[float, ...]:
    """Move levels towards noise (``shift`` > 1) or towards data; 1 changes nothing."""
    if not (math.isfinite(shift) and shift > 0):
        raise ConfigError(f"shift: expected a finite number above 0, got {shift}")
    # k l + (1 - l) is 1 + (k - 1) l written so that levels 0 and 1 stay exactly where they are.
    moved = tuple(shift * level / (shift * level + (1 - level)) for level in levels)
    return moved if shift != 1 else tuple(levels)


def require_levels(levels: Sequence[float]) -> None:
    """Refuse levels that no sampler can follow.

    Raises:
        ConfigError: fewer than two, outside [0, 1], not finite, or not strictly decreasing.
    """
    if len(levels) < 2:
        raise ConfigError(f"levels: expected at least two, start and end, got {len(levels)}")
    if not all(0 <= level <= 1 for level in levels):
        raise ConfigError(f"levels: expected numbers in [0, 1], got {_listed(levels)}")
    if any(after >= before for before, after in pairwise(levels)):
        raise ConfigError(
            f"levels: expected each below the one before it, got {_listed(levels)}; "
            "use fewer steps or a smaller shift"
        )


def _require_steps(steps: int) -> None:
    if steps < 1:
        raise ConfigError(f"steps: expected at least 1, got {steps}")


def _listed(levels: Sequence[float]) -> str:
    shown = ", ".join(f"{level:.6g}" for level in levels[:8])
    return shown + (", ..." if len(levels) > 8 else "")
