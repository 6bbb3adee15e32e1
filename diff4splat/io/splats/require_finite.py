"""Gaussians that can be written: every number of them is finite in float32."""

from dataclasses import fields

import torch

from diff4splat.errors import InputError
from diff4splat.scene.gaussians import Gaussians


def require_finite(gaussians: Gaussians, where: str) -> None:
    """Require numbers that a file can hold; ``where`` names the file.

    Raises:
        InputError: there is no Gaussian, or a value is NaN, infinite or beyond float32.
    """
    if not len(gaussians):
        raise InputError(f"{where}: expected at least one Gaussian, got none")
    for field in fields(gaussians):
        broken = ~torch.isfinite(getattr(gaussians, field.name).float())
        if bool(broken.any()):
            raise InputError(
                f"{where}: expected finite Gaussians, got {int(broken.sum())} numbers of "
                f"'{field.name}' that are NaN, infinite or too large"
            )
