"""Errors between two results, each with its unit in its name."""

import torch
from jaxtyping import Float
from torch import Tensor

BEST_DB = 150.0
"""What equal images count as, so that means stay finite."""


def psnr_db(result: Float[Tensor, "*d"], reference: Float[Tensor, "*d"]) -> float:
    """Of images in [0, 1]; equal ones have ``BEST_DB``."""
    square = (result.clamp(0, 1) - reference.clamp(0, 1)).square().mean()
    return min(BEST_DB, float(-10 * torch.log10(square.clamp_min(1e-30))))


def mean_psnr_db(results: Tensor, references: Tensor) -> float:
    """Mean over the first axis."""
    values = [psnr_db(*pair) for pair in zip(results, references, strict=True)]
    return sum(values) / len(values)


def relative_depth(result: Float[Tensor, "*d"], reference: Float[Tensor, "*d"]) -> float:
    """Mean |z - z'| / z' over pixels where both have a surface."""
    both = (result > 0) & (reference > 0)
    if not bool(both.any()):
        return 0.0
    return float(((result - reference).abs() / reference.clamp_min(1e-9))[both].mean())
