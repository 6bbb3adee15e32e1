"""Steps of the sampler ``fitted``: levels and weights, fitted to the video model ``small``.

``python -m benchmarks.sampling.fit_steps`` makes ``fitted_steps.json`` again: under the default
guidance, on photographs and drawn worlds that nothing is measured on.
"""

import json
from functools import cache
from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.flow.fitted import FittedSteps

FILE = Path(__file__).with_suffix(".json")


@cache
def known_steps() -> dict[int, FittedSteps]:
    """By the number of steps."""
    made = [
        FittedSteps(
            levels=tuple(map(float, one["levels"])),
            weights=tuple(tuple(map(float, row)) for row in one["weights"]),
        )
        for one in json.loads(FILE.read_text())
    ]
    return {len(one.levels): one for one in made}


def find_steps(count: int) -> FittedSteps:
    """Those of one number of steps.

    Raises:
        ConfigError: nothing was fitted for it.
    """
    if count not in known_steps():
        known = " or ".join(map(str, known_steps()))
        raise ConfigError(f"--steps: expected {known} with --sampler fitted, got {count}")
    return known_steps()[count]
