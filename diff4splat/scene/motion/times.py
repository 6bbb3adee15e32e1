"""The one check of times that every motion makes."""

import math
from contextlib import suppress
from numbers import Real

import torch
from torch import Tensor

from diff4splat.errors import InputError

LATEST_S = float(torch.finfo(torch.float32).max)


def require_time_s(time_s: object) -> None:
    """A number of seconds that float32 can hold; a tensor of one number will do.

    Raises:
        InputError: infinity, NaN, a bool, a larger number, or no number at all.
    """
    seconds = math.nan
    if isinstance(time_s, Real | Tensor) and not isinstance(time_s, bool):
        # Integers beyond every float, and tensors of several numbers.
        with suppress(OverflowError, RuntimeError):
            seconds = float(time_s)
    if not abs(seconds) <= LATEST_S:
        # Integers may have more digits than Python prints.
        shown = "a huge integer" if type(time_s) is int else repr(time_s)[:60]
        raise InputError(f"time_s: expected a finite number of seconds, got {shown}")
