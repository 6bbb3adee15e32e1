"""Native 4D Gaussians to a scene's Gaussians with velocity and pulse, one to one, and back.

Axes: ``n`` Gaussians, ``o`` orders in time (1 to 3), ``k`` harmonics. With the velocity v, the
covariance of the slice Σ' and the deviation σ of the pulse (Yang et al., arXiv 2310.10642)

    Σ_tt = σ²,  Σ_xt = σ² v,  Σ_xyz = Σ' + σ² v vᵀ

has the factor A = [[R' diag(scales'), σ v], [0, σ]]; its singular vectors and values are the
rotation and scales of the 4D Gaussian. Both ways go through float64 and have no gradient, because
axes of equal scales have none; the motion itself is differentiable.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry import quaternion
from diff4splat.geometry.rotation_4d import quaternion_pair
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import GATE, SpacetimeMotion
from diff4splat.scene.motion.spacetime_covariance import SpacetimeCovariance, conditional


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacetimeGaussians:
    """Gaussians in space-time with their looks, as Yang et al. define them."""

    covariance: SpacetimeCovariance
    opacities: Float[Tensor, " n"]
    """Probabilities at the time centre."""
    orders: Float[Tensor, "n o k 3"]
    """Spherindrical harmonics of order 0, 1 and 2 in time."""

    def __post_init__(self) -> None:
        count, got = len(self.covariance.means), tuple(self.orders.shape)
        if len(self.opacities) != count:
            raise ShapeError(
                f"SpacetimeGaussians.opacities: expected {count}, got {len(self.opacities)}"
            )
        if len(got) != 4 or got[0] != count or got[1] not in (1, 2, 3) or got[3] != 3:
            want = (count, "1, 2 or 3", "harmonics", 3)
            raise ShapeError(f"SpacetimeGaussians.orders: expected {want}, got {got}")


@torch.no_grad()
def to_spacetime(
    primitives: SpacetimeGaussians,
    *,
    time_range_s: tuple[float, float],
    period_s: float,
    gate: float = GATE,
) -> tuple[Gaussians, SpacetimeMotion]:
    """The slice of each Gaussian at its time centre, and how it moves, fades and changes colour.

    ``period_s`` is that of the first order in time; the authors take the length of their clip.

    Raises:
        InputError: covariances whose slices at one time overflow.
    """
    orders = primitives.orders
    slices = conditional(primitives.covariance.to(torch.float64))
    if not bool(torch.isfinite(slices.factors).all()):
        raise InputError("SpacetimeGaussians.covariance: expected finite slices, got others")
    axes, scales, _ = torch.linalg.svd(slices.factors, full_matrices=False)
    axes = torch.cat([axes[..., :2], axes[..., 2:] * torch.det(axes).sign()[:, None, None]], -1)
    gaussians = Gaussians(
        means=slices.means.to(orders),
        quats=quaternion.from_matrix(axes).to(orders),
        scales=scales.to(orders),
        opacities=primitives.opacities,
        sh=orders[:, 0],
    )
    motion = SpacetimeMotion(
        moving_index=torch.arange(len(orders), device=orders.device),
        velocities=slices.velocities.to(orders),
        time_centers_s=slices.time_centers_s.to(orders),
        time_deviations_s=slices.time_deviations_s.to(orders),
        time_range_s=time_range_s,
        color_waves=orders[:, 1:] if orders.shape[1] > 1 else None,
        period_s=period_s,
        gate=gate,
    )
    return gaussians, motion


@torch.no_grad()
def from_spacetime(gaussians: Gaussians, motion: SpacetimeMotion) -> SpacetimeGaussians:
    """The 4D Gaussians whose slices these are; range, period and gate are not part of them.

    Raises:
        InputError: some Gaussian has no pulse, or one that never ends: in space-time it would be
            infinitely long.
    """
    _require_finite_pulses(len(gaussians), motion)
    axes, scales, _ = torch.linalg.svd(_factor(gaussians, motion))
    rotation, scales = _time_last(axes, scales)
    left, right = quaternion_pair(rotation)
    means = torch.cat([gaussians.means, motion.time_centers_s[:, None]], -1)
    orders = gaussians.sh[:, None]
    if motion.color_waves is not None:
        orders = torch.cat([orders, motion.color_waves], 1)
    covariance = SpacetimeCovariance(
        means=means, scales=scales.to(means), left_quats=left.to(means), right_quats=right.to(means)
    )
    return SpacetimeGaussians(covariance=covariance, opacities=gaussians.opacities, orders=orders)


def split_orders(coefficients: Float[Tensor, "n c 3"], harmonics: int) -> Float[Tensor, "n o k 3"]:
    """Orders in time of a flat list with the index ``harmonics`` · order + harmonic.

    Raises:
        ShapeError: the list does not hold one, two or three whole orders.
    """
    count = coefficients.shape[1]
    if count not in (harmonics, 2 * harmonics, 3 * harmonics):
        raise ShapeError(
            f"coefficients: expected {harmonics}, {2 * harmonics} or {3 * harmonics}, got {count}"
        )
    return coefficients.unflatten(1, (-1, harmonics))


def join_orders(orders: Float[Tensor, "n o k 3"]) -> Float[Tensor, "n c 3"]:
    """The flat list that ``split_orders`` takes."""
    return orders.flatten(1, 2)


def _require_finite_pulses(count: int, motion: SpacetimeMotion) -> None:
    lasting = count - len(motion.moving_index) + int(motion.time_deviations_s.isinf().sum())
    if lasting:
        raise InputError(
            f"4D Gaussians: expected a pulse of finite length for each of {count}, got {lasting} "
            "without; give these a deviation of many clip lengths"
        )


def _factor(gaussians: Gaussians, motion: SpacetimeMotion) -> Float[Tensor, "n 4 4"]:
    """A with Σ = A Aᵀ: the slice beside the line along which time shifts it."""
    slices = quaternion.to_matrix(gaussians.quats.double()) * gaussians.scales.double()[:, None]
    deviations = motion.time_deviations_s.double()[:, None]
    factor = slices.new_zeros(len(gaussians), 4, 4)
    factor[:, :3, :3] = slices
    factor[:, :3, 3] = motion.velocities.double() * deviations
    factor[:, 3, 3] = deviations[:, 0]
    return factor


def _time_last(
    axes: Float[Tensor, "n 4 4"], scales: Float[Tensor, "n 4"]
) -> tuple[Float[Tensor, "n 4 4"], Float[Tensor, "n 4"]]:
    """Proper rotations, with the axis that points most along time in the last column."""
    order = axes[:, 3].abs().argsort(-1)
    axes = axes.gather(-1, order[:, None].expand_as(axes))
    axes = axes * torch.where(axes[:, 3:, :] < 0, -1.0, 1.0)
    first = axes[..., :1] * torch.det(axes).sign()[:, None, None]
    return torch.cat([first, axes[..., 1:]], -1), scales.gather(-1, order)
