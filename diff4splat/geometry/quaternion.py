"""Rotation algebra on unit quaternions.

Axes: ``*b`` batch. Order is (w, x, y, z). A zero quaternion means "no rotation", so that a network
that outputs zeros, or a damaged file, still gives a finite scene with finite gradients.
"""

import torch
from jaxtyping import Float
from torch import Tensor


def identity_like(quats: Float[Tensor, "*b 4"]) -> Float[Tensor, "*b 4"]:
    """(1, 0, 0, 0) in the shape, dtype and device of ``quats``."""
    return torch.eye(4, dtype=quats.dtype, device=quats.device)[0].expand(quats.shape)


def normalize(quats: Float[Tensor, "*b 4"]) -> Float[Tensor, "*b 4"]:
    """Unit quaternions; zero becomes the identity with zero gradient, NaN stays NaN."""
    # Dividing by the largest entry first keeps 1e-30 and 1e30 from under- and overflowing.
    largest = quats.abs().amax(-1, keepdim=True)
    zero = largest == 0
    scaled = quats / torch.where(zero, 1.0, largest).detach()
    safe = torch.where(zero, identity_like(quats), scaled)
    return safe / safe.square().sum(-1, keepdim=True).sqrt()


def multiply(left: Float[Tensor, "*b 4"], right: Float[Tensor, "*#b 4"]) -> Float[Tensor, "*b 4"]:
    """Hamilton product: rotates by ``right`` first, then by ``left``."""
    w1, x1, y1, z1 = left.unbind(-1)
    w2, x2, y2, z2 = right.unbind(-1)
    return torch.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        -1,
    )


def conjugate(quats: Float[Tensor, "*b 4"]) -> Float[Tensor, "*b 4"]:
    """The inverse rotation of a unit quaternion."""
    return torch.cat([quats[..., :1], -quats[..., 1:]], -1)


def to_matrix(quats: Float[Tensor, "*b 4"]) -> Float[Tensor, "*b 3 3"]:
    """Rotation matrices of (not necessarily normalised) quaternions."""
    w, x, y, z = normalize(quats).unbind(-1)
    rows = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return torch.stack(rows, -1).unflatten(-1, (3, 3))


def from_matrix(matrices: Float[Tensor, "*b 3 3"]) -> Float[Tensor, "*b 4"]:
    """Unit quaternions with w ≥ 0 of rotation matrices (Shepperd's method, best of four pivots)."""
    m = matrices
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    wx, wy, wz = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    xy, xz, yz = (
        m[..., 1, 0] + m[..., 0, 1],
        m[..., 2, 0] + m[..., 0, 2],
        m[..., 2, 1] + m[..., 1, 2],
    )
    # Row i is 4 q_i q: parallel to q, and longest for the largest component.
    candidates = torch.stack(
        [
            torch.stack([1 + xx + yy + zz, wx, wy, wz], -1),
            torch.stack([wx, 1 + xx - yy - zz, xy, xz], -1),
            torch.stack([wy, xy, 1 - xx + yy - zz, yz], -1),
            torch.stack([wz, xz, yz, 1 - xx - yy + zz], -1),
        ],
        -2,
    )
    pivot = torch.stack([xx + yy + zz, xx - yy - zz, yy - xx - zz, zz - xx - yy], -1).argmax(-1)
    index = pivot[..., None, None].expand(*pivot.shape, 1, 4)
    quats = normalize(candidates.gather(-2, index).squeeze(-2))
    return torch.where(quats[..., :1] < 0, -quats, quats)


def from_axis_angle(
    axis: Float[Tensor, "*b 3"], angle_rad: Float[Tensor, "*#b"]
) -> Float[Tensor, "*b 4"]:
    """Rotation by ``angle_rad`` around ``axis`` (normalised here; must not be zero)."""
    half = 0.5 * angle_rad[..., None]
    direction = torch.nn.functional.normalize(axis, dim=-1)
    return torch.cat([half.cos().expand_as(direction[..., :1]), half.sin() * direction], -1)


def rotate(quats: Float[Tensor, "*b 4"], vectors: Float[Tensor, "*#b 3"]) -> Float[Tensor, "*b 3"]:
    """Turn ``vectors`` by ``quats``."""
    return (to_matrix(quats) @ vectors[..., None]).squeeze(-1)


HALF_TURN = 1e-4
"""Cosine of quaternions up to which their rotations are half a turn apart, to rounding; then both
arcs are as short, and the one from the quaternions' own signs is taken by every implementation."""


def slerp(
    start: Float[Tensor, "*b 4"], stop: Float[Tensor, "*#b 4"], weight: Float[Tensor, "*#b"]
) -> Float[Tensor, "*b 4"]:
    """Constant-speed rotation along the shorter arc; ``weight`` 0 is ``start``, 1 is ``stop``.

    Half a turn goes from ``start`` to ``stop`` as they are; −``stop`` would be the other way round.
    """
    start, stop = normalize(start), normalize(stop)
    cosine = (start * stop).sum(-1, keepdim=True)
    other_way = cosine < -HALF_TURN
    stop, cosine = torch.where(other_way, -stop, stop), torch.where(other_way, -cosine, cosine)
    weight = weight[..., None]
    # Below about 1e-3 rad the linear blend is exact to rounding and keeps the gradient finite.
    nearby = cosine > 1 - 1e-6
    angle = torch.where(nearby, 0.5, cosine).clamp(max=1.0).acos()
    from_start = torch.where(nearby, 1 - weight, torch.sin((1 - weight) * angle) / torch.sin(angle))
    from_stop = torch.where(nearby, weight, torch.sin(weight * angle) / torch.sin(angle))
    return normalize(from_start * start + from_stop * stop)
