"""The distortion of ``OpenCVPinhole`` on the plane z = 1, its Jacobian and its inverse.

Symbols as in ``opencv_pinhole``. A mapping whose Jacobian has a positive symmetric part throughout
a convex region is one-to-one there. The radial part alone has that exactly up to its turning point;
with the other terms it is asked for at samples of the way from the centre to a point.
"""

import math
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy.polynomial import polynomial
from torch import Tensor

from diff4splat.geometry.lenses.newton import solve_rising
from diff4splat.geometry.lenses.polar import LARGEST_TANGENT, length
from diff4splat.geometry.lenses.polynomial import FLAT, RESIDUAL, first_positive_root

STEPS = 50
"""Newton steps at most in the plane; four or five do."""

SAMPLES = 8
"""Places between the centre and a point where the mapping must not fold."""


class Distortion(NamedTuple):
    """Coefficients in the order of ``OpenCVPinhole``."""

    radial: Float[Tensor, "6"]
    tangential: Float[Tensor, "2"]
    thin_prism: Float[Tensor, "4"]


def radial_factor(
    radial: Float[Tensor, "6"], squared: Float[Tensor, "*b"]
) -> tuple[Float[Tensor, "*b"], Float[Tensor, "*b"]]:
    """The factor f and df/du at u."""
    k = radial.to(squared.dtype)
    top = 1 + squared * (k[0] + squared * (k[1] + squared * k[2]))
    bottom = 1 + squared * (k[3] + squared * (k[4] + squared * k[5]))
    top_slope = k[0] + squared * (2 * k[1] + squared * 3 * k[2])
    bottom_slope = k[3] + squared * (2 * k[4] + squared * 3 * k[5])
    factor = top / bottom
    return factor, (top_slope - factor * bottom_slope) / bottom


def distort(terms: Distortion, ideal: Float[Tensor, "*b 2"]) -> Float[Tensor, "*b 2"]:
    """(x_d, y_d) of (x, y)."""
    (p_1, p_2), s = terms.tangential.to(ideal.dtype), terms.thin_prism.to(ideal.dtype)
    x, y = ideal.unbind(-1)
    squared = x * x + y * y
    factor, _ = radial_factor(terms.radial, squared)
    shift_x = 2 * p_1 * x * y + p_2 * (squared + 2 * x * x) + squared * (s[0] + s[1] * squared)
    shift_y = p_1 * (squared + 2 * y * y) + 2 * p_2 * x * y + squared * (s[2] + s[3] * squared)
    return torch.stack([x * factor + shift_x, y * factor + shift_y], -1)


def jacobian(terms: Distortion, ideal: Float[Tensor, "*b 2"]) -> Float[Tensor, "*b 2 2"]:
    """∂(x_d, y_d) / ∂(x, y)."""
    (p_1, p_2), s = terms.tangential.to(ideal.dtype), terms.thin_prism.to(ideal.dtype)
    x, y = ideal.unbind(-1)
    squared = x * x + y * y
    factor, slope = radial_factor(terms.radial, squared)
    prism_x, prism_y = 2 * (s[0] + 2 * s[1] * squared), 2 * (s[2] + 2 * s[3] * squared)
    mixed = 2 * x * y * slope + 2 * p_1 * x + 2 * p_2 * y
    rows = [
        factor + 2 * x * x * slope + 2 * p_1 * y + 6 * p_2 * x + prism_x * x,
        mixed + prism_x * y,
        mixed + prism_y * x,
        factor + 2 * y * y * slope + 6 * p_1 * y + 2 * p_2 * x + prism_y * y,
    ]
    return torch.stack(rows, -1).unflatten(-1, (2, 2))


def inside(terms: Distortion, ideal: Float[Tensor, "*b 2"]) -> Bool[Tensor, "*b"]:
    """Where (x, y) lies before the first turning point, pole or fold on its way from the centre."""
    exists = length(ideal) < largest_tangent(terms)
    ideal = torch.where(exists[..., None], ideal, torch.zeros_like(ideal))
    for share in torch.linspace(1, 0, SAMPLES + 1)[:-1].tolist():
        exists = exists & _rises(jacobian(terms, share * ideal))
    return exists


def _rises(slopes: Float[Tensor, "*b 2 2"]) -> Bool[Tensor, "*b"]:
    """Where the symmetric part of the Jacobian is positive."""
    mean = (slopes[..., 0, 0] + slopes[..., 1, 1]) / 2
    half = (slopes[..., 0, 0] - slopes[..., 1, 1]) / 2
    shear = (slopes[..., 0, 1] + slopes[..., 1, 0]) / 2
    return mean - torch.hypot(half, shear) > FLAT


def largest_tangent(terms: Distortion) -> float:
    """√u at the first turning point or pole of √u f, at most ``LARGEST_TANGENT``."""
    k = terms.radial.detach().double().cpu().numpy()
    top, bottom = np.array([1, *k[:3]]), np.array([1, *k[3:]])
    powers = np.arange(4)
    # d(r N/D)/dr = ((N + 2 u N') D - 2 u N D') / D²
    turning = polynomial.polymul(top + 2 * powers * top, bottom) - polynomial.polymul(
        top, 2 * powers * bottom
    )
    first = min(first_positive_root(turning), first_positive_root(bottom))
    return min(math.sqrt(first), LARGEST_TANGENT)


def undistort(
    terms: Distortion, points: Float[Tensor, "*b 2"]
) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
    """(x, y) of (x_d, y_d) by Newton's method in float64, and where it was found; 0 elsewhere."""
    with torch.no_grad():
        target = points.detach().double()
        limit = largest_tangent(terms)
        root = _descend(terms, target, _radial_start(terms, target, limit), limit)
        slopes = jacobian(terms, root)
        error = length(distort(terms, root) - target)
        exists = (error <= RESIDUAL * (1 + length(target))) & inside(terms, root)
        root = torch.where(exists[..., None], root, torch.zeros_like(root)).to(points.dtype)
        identity = torch.eye(2, dtype=slopes.dtype, device=slopes.device)
        slopes = torch.where(exists[..., None, None], slopes, identity)
        inverse = torch.linalg.inv(slopes).to(points.dtype)
    safe = torch.where(exists[..., None], points, torch.zeros_like(points))
    residual = distort(terms, root) - safe
    change = inverse @ (residual - residual.detach())[..., None]
    return root - change[..., 0], exists


def _radial_start(terms: Distortion, target: Tensor, limit: float) -> Tensor:
    """The solution without tangential and thin-prism terms."""
    radius = length(target)

    def evaluate(r: Tensor) -> tuple[Tensor, Tensor]:
        factor, slope = radial_factor(terms.radial, r * r)
        return r * factor, factor + 2 * r * r * slope

    # From further out, where the slope all but vanishes, the first step would go anywhere.
    upper = 0.95 * limit
    start = solve_rising(evaluate, radius, radius.clamp_max(upper / 2), upper)
    return target * (start / radius.clamp_min(1e-30))[..., None]


def _descend(terms: Distortion, target: Tensor, start: Tensor, limit: float) -> Tensor:
    """Newton steps, each halved until it lowers the residual and stays within ``limit``."""
    root, residual = start, distort(terms, start) - target
    share = torch.ones_like(target[..., 0])
    for _ in range(STEPS):
        step = _solve_two(jacobian(terms, root), residual)
        candidate = root - share[..., None] * step
        attempt = distort(terms, candidate) - target
        better = (length(attempt) < length(residual)) & (length(candidate) < limit)
        root = torch.where(better[..., None], candidate, root)
        residual = torch.where(better[..., None], attempt, residual)
        share = torch.where(better, (2 * share).clamp_max(1.0), share / 2)
        if bool(((length(residual) <= 1e-15 * (1 + length(target))) | (share < 1e-4)).all()):
            break
    return root


def _solve_two(slopes: Tensor, values: Tensor) -> Tensor:
    """Two linear equations by Cramer's rule; not finite where the matrix is singular."""
    (a, b), (c, d) = (row.unbind(-1) for row in slopes.unbind(-2))
    first, second = values.unbind(-1)
    solved = torch.stack([d * first - b * second, a * second - c * first], -1)
    return solved / (a * d - b * c)[..., None]
