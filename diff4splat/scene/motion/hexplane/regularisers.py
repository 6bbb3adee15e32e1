"""Penalties that keep planes smooth and time planes near one.

Axes: planes are ``rj ri c``. With S(P) the mean squared second difference along the rows (y for xy,
z for xz and yz, time for the others) summed over levels (4D Gaussians, arXiv 2310.08528):

    space  = Σ_l Σ_{xy, xz, yz} S        time = Σ_l Σ_{xt, yt, zt} S
    static = Σ_l Σ_{xt, yt, zt} mean |1 − P|
"""

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float
from torch import Tensor

from diff4splat.scene.motion.hexplane.planes import SPATIAL, TEMPORAL, HexPlanes


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanePenalties:
    """Three numbers to weigh and add to a loss."""

    space: Float[Tensor, ""]
    """Roughness of the planes without time."""
    time: Float[Tensor, ""]
    """Roughness of the planes with time: along time, and along space where asked for."""
    static: Float[Tensor, ""]
    """Distance of the planes with time from one, at which nothing changes in time."""


def penalties(planes: HexPlanes, along: Literal["rows", "both"] = "rows") -> PlanePenalties:
    """All three; ``rows`` is what 4DGaussians penalises, ``both`` adds the columns."""
    spatial = [level[k] for level in planes.levels for k in SPATIAL]
    temporal = [level[k] for level in planes.levels for k in TEMPORAL]
    return PlanePenalties(
        space=_total([roughness(plane, along) for plane in spatial]),
        time=_total([roughness(plane, along) for plane in temporal]),
        static=_total([(1 - plane).abs().mean() for plane in temporal]),
    )


def roughness(
    plane: Float[Tensor, "rj ri c"], along: Literal["rows", "both"] = "rows"
) -> Float[Tensor, ""]:
    """Mean squared second difference along the rows, or its sum over both axes."""
    axes = (0,) if along == "rows" else (0, 1)
    return _total([_second_difference(plane, axis) for axis in axes])


def _second_difference(plane: Tensor, axis: int) -> Tensor:
    if plane.shape[axis] < 3:
        return plane.sum() * 0
    return plane.diff(n=2, dim=axis).square().mean()


def _total(parts: list[Tensor]) -> Tensor:
    return sum(parts[1:], parts[0])
