"""What a ray sees of ellipsoids of constant density, whatever their order: the exact integral.

Between neighbouring entries and exits the set of ellipsoids that the ray is inside of does not
change: with density σ = Σ σ_k and colour c = Σ σ_k c_k / σ a stretch of length Δ adds
T (1 - e^(-σ Δ)) c, and leaves T e^(-σ Δ) (Mai et al., EVER, arXiv 2410.01804).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True)
class Segment:
    """One ellipsoid along a ray."""

    entry: float
    exit: float
    density: float
    color: float

    @property
    def alpha(self) -> float:
        """What it hides alone."""
        return 1 - math.exp(-self.density * (self.exit - self.entry))


def integrate(segments: Sequence[Segment]) -> tuple[float, float]:
    """(colour, light that is left)."""
    events = sorted({at for segment in segments for at in (segment.entry, segment.exit)})
    color, light = 0.0, 1.0
    for begin, end in pairwise(events):
        inside = [part for part in segments if part.entry <= begin and part.exit >= end]
        density = sum(part.density for part in inside)
        if density > 0:
            left = math.exp(-density * (end - begin))
            mean = sum(part.density * part.color for part in inside) / density
            color, light = color + light * (1 - left) * mean, light * left
    return color, light
