"""Raw network outputs to activated values. Zero means identity: raw 0 gives exactly the base value.

Axes: ``*b`` any. Every function is continuous, has a gradient that is not zero at raw 0, and stays
finite, value and gradient, for raw values of any finite size. float32 and float64 only: poses and
depths do not survive half precision.

    distance  base · exp(L tanh(raw / L))       within a factor e^L, d(log distance)/d(raw) = 1 at 0
    scale     footprint · exp(L tanh(raw / L))  the same law
    rotation  normalize((1, 0, 0, 0) + raw)
    opacity   sigmoid(logit(base) + raw)        written with odds: base 0 and 1 are exact too
    colour    base + tanh(raw)                  reaches all of [0, 1] from any base, gradient 1 at 0
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion

LOG_ODDS_LIMIT = 40.0
"""e^40 and its square are finite in float32; an opacity differs from 0 or 1 by 4e-18 there."""


LARGEST_SHARE = 0.999
"""Of the limit, in ``raw_log_ratio``: its inverse has no finite value at the limit."""


def require_full_precision(tensor: Tensor, what: str) -> None:
    """Refuse half precision.

    Raises:
        ShapeError: the dtype is neither float32 nor float64.
    """
    if tensor.dtype not in (torch.float32, torch.float64):
        raise ShapeError(
            f"{what}: expected float32 or float64, got {tensor.dtype}; convert with .float()"
        )


def log_ratio(raw: Float[Tensor, "*b"], limit: float) -> Float[Tensor, "*b"]:
    """L tanh(raw / L): the logarithm of a bounded factor, slope 1 at 0."""
    require_full_precision(raw, "raw log ratio")
    return limit * torch.tanh(raw / limit)


def raw_log_ratio(ratio: Float[Tensor, "*b"], limit: float) -> Float[Tensor, "*b"]:
    """The raw value that ``log_ratio`` brings to ``ratio``; beyond the limit, just below it."""
    require_full_precision(ratio, "log ratio")
    share = (ratio / limit).clamp(-LARGEST_SHARE, LARGEST_SHARE)
    return limit * torch.atanh(share)


def bounded_factor(raw: Float[Tensor, "*b"], limit: float) -> Float[Tensor, "*b"]:
    """exp(L tanh(raw / L)), between e^−L and e^L."""
    return log_ratio(raw, limit).exp()


def rotation(raw: Float[Tensor, "*b 4"]) -> Float[Tensor, "*b 4"]:
    """Unit quaternion near the identity; raw = (−1, 0, 0, 0) exactly counts as the identity too."""
    require_full_precision(raw, "raw rotation")
    return quaternion.normalize(raw + quaternion.identity_like(raw))


def opacity(raw: Float[Tensor, "*b"], base: Float[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """sigmoid(logit(base) + raw) = base / (base + (1 − base) e^−raw), for ``base`` in [0, 1]."""
    require_full_precision(raw, "raw opacity")
    inverse_odds = (-raw.clamp(-LOG_ODDS_LIMIT, LOG_ODDS_LIMIT)).exp()
    return base / (base + (1 - base) * inverse_odds)


def color(raw: Float[Tensor, "*b 3"], base: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
    """Base plus tanh(raw); may leave [0, 1], renderers clamp."""
    require_full_precision(raw, "raw colour")
    return base + torch.tanh(raw)


def stretch(
    raw: Float[Tensor, "*b 3"], raw_scale: Float[Tensor, "*b 3"], limit: float
) -> Float[Tensor, "*b 3"]:
    """Logarithm of scale_t / scale_0 when ``raw`` is added to the canonical raw scale."""
    return log_ratio(raw_scale + raw, limit) - log_ratio(raw_scale, limit)
