"""Rotations of space-time from two unit quaternions, and back.

Axes: ``*b`` batch; columns and rows are (x, y, z, t). With a vector read backwards as the
quaternion v = (t, z, y, x), a rotation is v ↦ left ⊗ v ⊗ conjugate(right). Equal quaternions
(w, x, y, z) turn space alone, like the ordinary quaternion (w, −z, −y, −x). This is the order of
Yang et al. (ICLR 2024, arXiv 2310.10642): R = J (L M) J with J the reversal of the axes.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion


def rotation_4d(
    left: Float[Tensor, "*b 4"], right: Float[Tensor, "*b 4"]
) -> Float[Tensor, "*b 4 4"]:
    """Rotation matrices of (not necessarily normalised) pairs; zero counts as (1, 0, 0, 0)."""
    shape = (*left.shape[:-1], 4, 4)
    before = quaternion.normalize(left)[..., None, :].expand(shape)
    after = quaternion.conjugate(quaternion.normalize(right))[..., None, :].expand(shape)
    reversed_axes = torch.eye(4, dtype=left.dtype, device=left.device).flip(0).expand(shape)
    turned = quaternion.multiply(quaternion.multiply(before, reversed_axes), after)
    return turned.flip(-1).mT


def quaternion_pair(
    rotations: Float[Tensor, "*b 4 4"],
) -> tuple[Float[Tensor, "*b 4"], Float[Tensor, "*b 4"]]:
    """The pair (left, right) of proper rotations; (−left, −right) is the same rotation.

    Expanded in the 16 rotations of pairs of unit quaternions, which are orthogonal matrices of
    squared norm 4, a rotation has the coefficients left · rightᵀ: a matrix of rank one.
    """
    units = torch.eye(4, dtype=rotations.dtype, device=rotations.device)
    table = rotation_4d(units[:, None].expand(4, 4, 4), units[None].expand(4, 4, 4))
    outer = torch.einsum("lrij,...ij->...lr", table, rotations) / 4
    # The longest row is far from zero whatever the rotation, so the division is safe.
    longest = outer.square().sum(-1).argmax(-1)[..., None, None].expand(*outer.shape[:-2], 1, 4)
    right = quaternion.normalize(outer.gather(-2, longest).squeeze(-2))
    left = quaternion.normalize((outer @ right[..., None]).squeeze(-1))
    return left, right
