"""How the lengths of a clip became metres: kept with it, so that nobody scales twice."""

import math
from dataclasses import dataclass, fields

from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleRecord:
    """What was done to the lengths of the source.

    Poses, depth and tracks were multiplied by ``factor``. Where depth was estimated as relative
    disparity d, its depth is 1 / (``disparity_scale`` · d + ``disparity_shift``); a shift is never
    applied to positions. None means that a number does not apply.
    """

    method: str
    """Such as ``baseline 0.063 m`` or ``disparity ransac irls``."""
    factor: float = 1.0
    disparity_scale: float | None = None
    disparity_shift: float | None = None
    normaliser: float | None = None
    """What the source had divided its lengths by, such as MegaSaM's."""
    inlier_share: float | None = None
    relative_error: float | None = None
    """Median over the inliers."""
    reference: str = ""
    """What the lengths were fitted to."""


def require_valid_scale(scale: ScaleRecord) -> None:
    """Refuse numbers that no fit gives.

    Raises:
        InputError: a number is not finite, or the factor is not above 0.
    """
    numbers = [(each.name, getattr(scale, each.name)) for each in fields(scale)]
    for name, value in numbers:
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"scale, {name}: expected a finite number, got {value}")
    if not scale.factor > 0:
        raise InputError(f"scale, factor: expected a number above 0, got {scale.factor}")
    if not scale.method:
        raise InputError("scale, method: expected the name of a method, got nothing; name it")
