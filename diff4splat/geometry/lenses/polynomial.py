"""Polynomials that rise from the centre of an image up to a limit, and their inverse.

Coefficients are ascending: c_0 + c_1 x + c_2 x² + …. Axes: ``k`` coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.lenses.newton import solve_rising, with_gradient

FLAT = 1e-6
"""Where the slope is below this part of its value at the centre, the polynomial has turned."""

RESIDUAL = 1e-10
"""What an inverse may leave, relative to the largest value."""


def horner(coefficients: Float[Tensor, " k"], x: Float[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """The polynomial at ``x``."""
    value = torch.zeros_like(x)
    for coefficient in coefficients.to(x.dtype).flip(0):
        value = value * x + coefficient
    return value


def derivative(coefficients: Float[Tensor, " k"]) -> Float[Tensor, " k-1"]:
    """Coefficients of the derivative."""
    powers = torch.arange(1, len(coefficients), device=coefficients.device)
    return coefficients[1:] * powers


def first_positive_root(coefficients: Sequence[float] | np.ndarray) -> float:
    """The smallest root x > 0, infinite when there is none; 0 when the constant vanishes.

    A pair of complex roots next to the real axis counts, so that a saddle is a turning point.
    """
    if coefficients[0] == 0:
        return 0.0
    # Read backwards they are the polynomial of 1 / x: vanishing high orders do no harm.
    inverses = np.roots(coefficients)
    real = inverses.real[
        (inverses.real > 0) & (np.abs(inverses.imag) <= 1e-6 * np.abs(inverses.real))
    ]
    return float(1 / real.max()) if real.size else float("inf")


def rising_limit(coefficients: Float[Tensor, " k"]) -> float:
    """The first x > 0 where the slope is not positive, or infinity."""
    return first_positive_root(derivative(coefficients.detach().double()).cpu().numpy())


@dataclass(frozen=True, slots=True)
class RisingCurve:
    """y = c_0 + c_1 x + … for x in [0, upper], where it rises (c_1 > 0)."""

    coefficients: Float[Tensor, " k"]
    upper: float
    """Finite."""

    def value(self, x: Float[Tensor, "*b"]) -> tuple[Float[Tensor, "*b"], Bool[Tensor, "*b"]]:
        """Values y at x, and where the curve has such an x; c_0 elsewhere."""
        exists = (x >= 0) & (x <= self.upper)
        exists &= self._rises(self._slope(x.detach().double()))
        return horner(self.coefficients, torch.where(exists, x, torch.zeros_like(x))), exists

    def inverse(self, y: Float[Tensor, "*b"]) -> tuple[Float[Tensor, "*b"], Bool[Tensor, "*b"]]:
        """Places x at y, and where the curve reaches such a y; 0 elsewhere. Solved in float64."""
        root, slope, exists = self._solve(y.detach().double())
        root, slope = root.to(y.dtype), slope.to(y.dtype)
        residual = horner(self.coefficients, root) - torch.where(exists, y, torch.zeros_like(y))
        return with_gradient(root, residual, slope), exists

    @torch.no_grad()
    def _solve(self, y: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        lowest = self.coefficients[0].double()
        highest = horner(self.coefficients, lowest.new_tensor(self.upper))
        exists = (y >= lowest) & (y <= highest)
        y = torch.where(exists, y, lowest)
        start = (y - lowest) / self.coefficients[1].double()
        root = solve_rising(
            lambda x: (horner(self.coefficients, x), self._slope(x)), y, start, self.upper
        )
        slope = self._slope(root)
        error = (horner(self.coefficients, root) - y).abs()
        exists = exists & (error <= RESIDUAL * (highest - lowest)) & self._rises(slope)
        return (
            torch.where(exists, root, torch.zeros_like(root)),
            torch.where(exists, slope, torch.ones_like(slope)),
            exists,
        )

    def _slope(self, x: Tensor) -> Tensor:
        return horner(derivative(self.coefficients.detach().double()), x)

    def _rises(self, slope: Tensor) -> Tensor:
        return slope > FLAT * self.coefficients[1].detach().double()
