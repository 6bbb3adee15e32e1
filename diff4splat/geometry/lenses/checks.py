"""What the constructors of lenses check, with the messages."""

import math

import torch
from torch import Tensor

from diff4splat.errors import InputError, ShapeError


def check_coefficients(name: str, values: Tensor, count: int) -> None:
    """Coefficients have the right shape and are numbers.

    Raises:
        ShapeError: another shape, or not floating-point.
        InputError: some are infinite or not a number.
    """
    if tuple(values.shape) != (count,) or not values.is_floating_point():
        raise ShapeError(
            f"{name}: expected ({count},) floating-point values, "
            f"got {tuple(values.shape)} of {values.dtype}"
        )
    if not bool(torch.isfinite(values.detach()).all()):
        raise InputError(
            f"{name}: expected finite values, got {values.tolist()}; calibrate the lens again"
        )


def check_angle(name: str, angle_rad: float) -> None:
    """An angle lies in (0, 2π].

    Raises:
        InputError: it does not.
    """
    # A full turn that was converted through float32 may come out a little larger.
    if not 0 < angle_rad <= 2 * math.pi * (1 + 1e-6):
        raise InputError(
            f"{name}: expected an angle in (0, 2π] radians, got {angle_rad}; "
            "convert degrees with math.radians"
        )
