"""Fit the weights of the sampler ``fitted`` to the shipped video model.

Run ``python -m benchmarks.sampling.fit_steps --out steps.json``. The inputs are photographs and
drawn worlds that ``report error-time`` does not measure on, with other seeds. For each number of
steps several spacings of the levels are tried; the best on the inputs that the fit has not seen is
fitted again to all of them.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.error_time.subjects.inputs import MEASURED, OTHER_PHOTOGRAPHS, OTHER_WORLDS
from diff4splat.error_time.subjects.video import batch, conditions, error
from diff4splat.flow.fitted import FittedSteps, fit_steps, integrate_fitted
from diff4splat.flow.guidance import DEFAULT_GUIDANCE
from diff4splat.flow.levels import piecewise_levels
from diff4splat.flow.multistep import piecewise2_step
from diff4splat.flow.sampler_types import VelocityFn
from diff4splat.generation.settings import LAST_LEVEL
from diff4splat.io.atomic import write_text

COUNT = len(OTHER_PHOTOGRAPHS) + len(OTHER_WORLDS)
UNSEEN = (2, 3, 8, 9)
"""Two photographs and two worlds."""
FIRST_SEED, REFERENCE_STEPS, DIGITS = 11, 140, 5
ABOVE = {8: (4, 5, 6), 12: (7, 8, 9)}
"""Numbers of levels above the lower end of guidance, by number of steps."""
POWERS = (1.0, 0.7)
"""Of the step, for logarithms of the levels below it."""
LOW = DEFAULT_GUIDANCE.low
States = Callable[[float], Tensor]
Field = tuple[VelocityFn, Tensor]
"""Velocity of all inputs at once, and their noise."""


def exact_states(field: Field) -> States:
    """States of a long integration, linear between its levels; at level 0 its end."""
    levels = piecewise_levels(REFERENCE_STEPS, (LOW,), LAST_LEVEL)
    (velocity, state), memory, known = field, None, []
    for pair in pairwise(levels):
        state, memory = piecewise2_step(velocity, state, pair, memory)
        known.append((memory.level, memory.state))
    known.append((0.0, state))

    def at(level: float) -> Tensor:
        for (high, before), (low, after) in pairwise(known):
            if low <= level <= high:
                return before + (high - level) / (high - low) * (after - before)
        raise ValueError(level)

    return at


def spaced(steps: int, above: int, power: float) -> tuple[float, ...]:
    """Even in the level down to the end of guidance, then logarithms by a power of the step."""
    below = steps - above
    upper = (1 - (1 - LOW) * step / above for step in range(above))
    lower = (LOW * (LAST_LEVEL / LOW) ** ((k / (below - 1)) ** power) for k in range(below - 1))
    return tuple(round(level, DIGITS) for level in (*upper, *lower, LAST_LEVEL))


def fitted(
    field: Field, exact: States, levels: Sequence[float], index: Sequence[int]
) -> FittedSteps:
    """Rows fitted to some of the inputs, rounded."""
    chosen = list(index)
    steps = fit_steps(*field, levels, exact, use=lambda states: states[chosen])
    rows = [[round(weight, DIGITS) for weight in row[:-1]] for row in steps.weights]
    return replace(steps, weights=tuple((*row, 1 - sum(row)) for row in rows))


@torch.no_grad()
def main() -> None:
    """Fit, choose, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file")
    options = parser.parse_args()
    every = [(conditions(MEASURED + index), FIRST_SEED + index) for index in range(COUNT)]
    field = batch(every, DEFAULT_GUIDANCE)
    exact, best = exact_states(field), []
    seen = [index for index in range(COUNT) if index not in UNSEEN]
    for steps, counts in ABOVE.items():
        tried = []
        for levels in (spaced(steps, above, power) for above in counts for power in POWERS):
            rows = fitted(field, exact, levels, seen)
            end = integrate_fitted(*field, rows)
            off = [error(end[part], exact(0.0)[part]) for part in (seen, list(UNSEEN))]
            print(f"{steps} steps, {levels}: seen {off[0]:.4f}, unseen {off[1]:.4f}", flush=True)
            tried.append((off[1], levels))
        best.append(fitted(field, exact, min(tried)[1], range(COUNT)))
    record = [{"levels": one.levels, "weights": one.weights} for one in best]
    write_text(options.out, json.dumps(record, indent=None) + "\n")


if __name__ == "__main__":
    main()
