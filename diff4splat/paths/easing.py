"""Easing: how progress along a segment follows time. Monotone maps of [0, 1] with fixed ends.

Axes: ``t`` frames. ``smooth`` is the cubic 3u² − 2u³ (no speed at either end), ``ease-in`` is u²
and ``ease-out`` is 1 − (1 − u)².
"""

from collections.abc import Callable
from typing import Literal, get_args

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.paths.messages import unknown_name

Easing = Literal["linear", "smooth", "ease-in", "ease-out"]

_CURVES: dict[str, Callable[[Tensor], Tensor]] = {
    "linear": lambda progress: progress,
    "smooth": lambda progress: progress * progress * (3 - 2 * progress),
    "ease-in": lambda progress: progress * progress,
    "ease-out": lambda progress: progress * (2 - progress),
}


def require_easing(easing: str) -> None:
    """Refuse names that are not easings.

    Raises:
        InputError: listing the known ones.
    """
    if easing not in _CURVES:
        raise InputError(unknown_name("easing", easing, get_args(Easing)))


def ease(progress: Float[Tensor, " t"], easing: Easing) -> Float[Tensor, " t"]:
    """Progress in [0, 1] after easing."""
    return _CURVES[easing](progress)
