"""Weighted least squares on a pixel grid: smooth, but free to step (Farbman et al. 2008).

    minimise over x:  Σ w (x − d)² + Σ c (x_i − x_j)²     c of every pair of neighbours

Axes: ``h w`` pixels. Solved by conjugate gradients, preconditioned by the diagonal, in float64 and
in one thread: the same bits on any number of cores.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.one_thread import one_thread

STEPS = 500
"""At most; as many as a value has to travel pixels, and some more."""
TOLERANCE = 1e-14
"""Of the first residual, squared and preconditioned, at which the solution is good enough."""
TINY = torch.finfo(torch.float64).tiny


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What holds the solution: at the data, and neighbours at each other."""

    weight: Float[Tensor, "h w"]
    """Of the data, above 0."""
    across: Float[Tensor, "h w-1"]
    """Between a pixel and the next one of its row, at least 0."""
    down: Float[Tensor, "h-1 w"]

    def product(self, values: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
        """The normal equations' matrix times ``values``."""
        result = self.weight * values
        flow = self.across * values.diff(dim=1)
        result[:, 1:] += flow
        result[:, :-1] -= flow
        flow = self.down * values.diff(dim=0)
        result[1:] += flow
        result[:-1] -= flow
        return result

    def diagonal(self) -> Float[Tensor, "h w"]:
        """Of that matrix."""
        result = self.weight.clone()
        result[:, 1:] += self.across
        result[:, :-1] += self.across
        result[1:] += self.down
        result[:-1] += self.down
        return result


@torch.no_grad()
def least_squares(values: Float[Tensor, "h w"], grid: Grid) -> Float[Tensor, "h w"]:
    """The minimum, started at ``values``: a weighted mean of them, so within their range."""
    with one_thread():
        found = _conjugate_gradients(values.double(), grid)
    return found.clamp(values.min(), values.max()).to(values)


def _conjugate_gradients(values: Float[Tensor, "h w"], grid: Grid) -> Float[Tensor, "h w"]:
    found, scale = values, grid.diagonal()
    residual = grid.weight * values - grid.product(values)
    scaled = residual / scale
    direction, energy = scaled, (residual * scaled).sum()
    least = TOLERANCE * energy + TINY
    for _ in range(STEPS):
        if energy <= least:
            break
        image = grid.product(direction)
        step = energy / (direction * image).sum()
        found, residual = found + step * direction, residual - step * image
        scaled = residual / scale
        before, energy = energy, (residual * scaled).sum()
        direction = scaled + energy / before * direction
    return found


def between_colors(
    rgb: Float[Tensor, "h w 3"], color_step: float, least: float
) -> tuple[Float[Tensor, "h w-1"], Float[Tensor, "h-1 w"]]:
    """For neighbours across and down: 1 of one colour, 1/e a ``color_step`` apart, or ``least``."""
    colors = rgb.double()
    across, down = (
        (-colors.diff(dim=axis).norm(dim=-1) / color_step).exp() + least for axis in (1, 0)
    )
    return across, down
