"""Axis-aligned boxes of the supports of Gaussians, at one time or over an interval.

Axes: ``n`` Gaussians. A box that holds nothing has corners at plus and minus infinity.
"""

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.trace.bvh.primitives import box
from diff4splat.render.trace.tables import Doubles

PRIMITIVES_PER_PART = 4096


class Boxes(NamedTuple):
    """Corners of boxes, n × 3 each."""

    lower: Doubles
    upper: Doubles


def swept_boxes(primitives: Doubles, reach: Doubles, earliest: float, latest: float) -> Boxes:
    """Boxes that hold ``primitives`` at every time from ``earliest`` to ``latest``."""
    count = len(primitives)
    boxes = Boxes(np.empty((count, 3)), np.empty((count, 3)))

    def work(first: int, last: int) -> None:
        box(first, last, primitives, reach, (float(earliest), float(latest)), *boxes)

    parallel_for(work, ranges(count, PRIMITIVES_PER_PART))
    return boxes


def empty_boxes(count: int) -> Boxes:
    """``count`` empty boxes."""
    return Boxes(np.full((count, 3), np.inf), np.full((count, 3), -np.inf))


def united(parts: Sequence[Boxes]) -> Boxes:
    """The boxes around several, as of the keys that an interval of a motion contains.

    That bounds what lies between the keys where shapes stay and means move in lines.
    """
    return reduce(
        lambda a, b: Boxes(np.minimum(a.lower, b.lower), np.maximum(a.upper, b.upper)), parts
    )
