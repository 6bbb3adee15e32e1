"""Rigid motions as 4×4 matrices named by the spaces they join: ``world_from_camera``.

Axes: ``*b`` batch. OpenCV camera axes: x right, y down, z forward.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError


def from_parts(
    rotation: Float[Tensor, "*b 3 3"], translation: Float[Tensor, "*b 3"]
) -> Float[Tensor, "*b 4 4"]:
    """Assemble [R t; 0 1]."""
    upper = torch.cat([rotation, translation[..., None]], -1)
    last_row = torch.eye(4, dtype=upper.dtype, device=upper.device)[3:].expand(
        *upper.shape[:-2], 1, 4
    )
    return torch.cat([upper, last_row], -2)


def invert(pose: Float[Tensor, "*b 4 4"]) -> Float[Tensor, "*b 4 4"]:
    """Exact inverse of a rigid motion: [Rᵀ −Rᵀt; 0 1]."""
    rotation = pose[..., :3, :3].mT
    return from_parts(rotation, -(rotation @ pose[..., :3, 3:]).squeeze(-1))


def transform_points(
    pose: Float[Tensor, "*b 4 4"], points: Float[Tensor, "*b n 3"]
) -> Float[Tensor, "*b n 3"]:
    """Carry ``points`` into the space on the left of ``pose``'s name."""
    return points @ pose[..., :3, :3].mT + pose[..., None, :3, 3]


def look_at(
    position: Float[Tensor, "*b 3"], target: Float[Tensor, "*#b 3"], down: Float[Tensor, "*#b 3"]
) -> Float[Tensor, "*b 4 4"]:
    """``world_from_camera`` of a camera at ``position`` that sees ``target`` in its centre.

    ``down`` is the world direction that should point down in the image; it must not be parallel
    to the viewing direction.
    """
    forward = torch.nn.functional.normalize(target - position, dim=-1)
    right = torch.nn.functional.normalize(
        torch.linalg.cross(down.expand_as(forward), forward), dim=-1
    )
    return from_parts(
        torch.stack([right, torch.linalg.cross(forward, right), forward], -1), position
    )


def require_rigid(poses: Float[Tensor, "*b 4 4"], what: str, tolerance: float = 1e-3) -> None:
    """Refuse matrices that are not rotations plus translations.

    Raises:
        InputError: a value is not finite, a rotation is left-handed, or it scales or shears.
    """
    poses = poses.detach()
    rotation = poses[..., :3, :3].double()
    if not bool(torch.isfinite(poses).all()):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity; repair the file")
    if bool((torch.linalg.det(rotation) < 0).any()):
        raise InputError(
            f"{what}: expected right-handed rotations (determinant +1), got determinant -1; "
            "one axis is mirrored, flip it in the file"
        )
    error = (
        (rotation @ rotation.mT - torch.eye(3, dtype=torch.float64, device=poses.device))
        .abs()
        .amax()
    )
    if float(error) > tolerance:
        raise InputError(
            f"{what}: expected rotations without scale or shear, got an error of {float(error):.2g}"
        )


def nearest_rotation(matrices: Float[Tensor, "*b 3 3"]) -> Float[Tensor, "*b 3 3"]:
    """The closest rotations (polar factor), for poses read from rounded text."""
    left, _, right = torch.linalg.svd(matrices)
    return left @ right
