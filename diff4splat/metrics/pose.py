"""How far an estimated camera path is from the true one.

Axes: ``t`` poses. Poses are ``world_from_camera``; lengths come out in the truth's unit, rotations
in degrees, each as root mean square over the path. As the program evo does
(https://github.com/MichaelGrupp/evo), in float64:

    aligned    s R p + r of the estimated positions p           Umeyama, IEEE TPAMI 1991
    absolute   T*_i⁻¹ T_i                                       per pose ("ATE", "APE")
    relative   (T*_i⁻¹ T*_{i+1})⁻¹ (T_i⁻¹ T_{i+1})               per step ("RPE")
"""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError, InputError
from diff4splat.metrics.checks import require_alike

PathAlignment = Literal["none", "rigid", "similarity"]
"""Nothing; rotation and translation; these and scale."""
FLATTEST = 1e-4
"""Spread of positions, as a share of their largest, below which they lie on a line or a point."""

MIN_RELATIVE_SPREAD = 1e-9
"""Extent of a path, as a share of its distance from the origin, below which it is rounding."""
RIGID = 1e-3
"""How far a rotation matrix may be from orthonormal: poses come from rounded text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathError:
    """Root mean squares over a path, after alignment."""

    absolute_translation: float
    absolute_rotation_deg: float
    relative_translation: float
    """Per step between neighbouring poses."""
    relative_rotation_deg: float
    scale: float
    """By which the estimated path was enlarged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Similarity:
    """p → scale · rotation p + translation."""

    scale: float
    rotation: Float[Tensor, "3 3"]
    translation: Float[Tensor, " 3"]

    def move(self, poses: Float[Tensor, "t 4 4"]) -> Float[Tensor, "t 4 4"]:
        """Poses in the other world; they stay rigid."""
        moved = poses.clone()
        moved[:, :3, :3] = self.rotation @ poses[:, :3, :3]
        moved[:, :3, 3] = self.scale * poses[:, :3, 3] @ self.rotation.mT + self.translation
        return moved


def path_error(
    estimated: Float[Tensor, "t 4 4"],
    truth: Float[Tensor, "t 4 4"],
    alignment: PathAlignment = "similarity",
) -> PathError:
    """All errors of one path.

    Raises:
        ConfigError: unknown alignment.
        ShapeError: the lengths differ.
        InputError: fewer than two poses, or one that is not rigid.
    """
    require_alike("estimated", estimated, truth)
    if len(truth) < 2:
        raise InputError(f"path: expected at least two poses, got {len(truth)}")
    for what, poses in (("estimated", estimated), ("truth", truth)):
        _require_rigid(poses, what)
    similarity = align_path(estimated, truth, alignment)
    estimated, truth = similarity.move(estimated.detach().double()), truth.detach().double()
    absolute = torch.linalg.solve(truth, estimated)
    relative = torch.linalg.solve(_steps(truth), _steps(estimated))
    return PathError(
        absolute_translation=_root_mean_square(absolute[:, :3, 3].norm(dim=-1)),
        absolute_rotation_deg=_root_mean_square(_angle_deg(absolute)),
        relative_translation=_root_mean_square(relative[:, :3, 3].norm(dim=-1)),
        relative_rotation_deg=_root_mean_square(_angle_deg(relative)),
        scale=similarity.scale,
    )


def align_path(
    estimated: Float[Tensor, "t 4 4"], truth: Float[Tensor, "t 4 4"], alignment: PathAlignment
) -> Similarity:
    """The best way to lay one path over the other.

    Where positions do not fix the rotation (all on a line, or in one place), the orientations do;
    where they do not fix the scale, it stays 1.

    Raises:
        ConfigError: unknown alignment.
    """
    if alignment not in ("none", "rigid", "similarity"):
        raise ConfigError(f"alignment: expected one of none, rigid, similarity, got {alignment!r}")
    if alignment == "none":
        identity = torch.eye(4, dtype=torch.float64, device=truth.device)
        return Similarity(scale=1.0, rotation=identity[:3, :3], translation=identity[:3, 3])
    estimated, truth = estimated.detach().double(), truth.detach().double()
    own, true = estimated[:, :3, 3], truth[:, :3, 3]
    own_mean, true_mean = own.mean(0), true.mean(0)
    own, true = own - own_mean, true - true_mean
    covariance = true.mT @ own / len(own)
    rotation = _rotation_of(covariance)
    if min(_spread(own), _spread(true)) < FLATTEST:
        rotation = _rotation_of((truth[:, :3, :3] @ estimated[:, :3, :3].mT).sum(0))
    scale = 1.0
    if alignment == "similarity" and float(own.abs().max()) > MIN_RELATIVE_SPREAD * float(
        own_mean.abs().max()
    ):
        fitted = float((rotation * covariance).sum() / own.square().sum(-1).mean())
        # A path that goes the opposite way, or nowhere, has no scale at which it fits.
        scale = fitted if fitted > 0 else 1.0
    return Similarity(
        scale=scale, rotation=rotation, translation=true_mean - scale * rotation @ own_mean
    )


def _rotation_of(matrix: Tensor) -> Tensor:
    """The rotation R with the largest trace of Rᵀ matrix."""
    left, _, right = torch.linalg.svd(matrix)
    flip = torch.ones(3, dtype=matrix.dtype, device=matrix.device)
    flip[2] = torch.linalg.det(left @ right).sign()
    return left * flip @ right


def _spread(centered: Tensor) -> float:
    """Second widest extent over the widest: 0 on a line."""
    values = torch.linalg.svdvals(centered)
    return float(values[1] / values[0]) if len(values) > 1 and values[0] > 0 else 0.0


def _steps(poses: Tensor) -> Tensor:
    return torch.linalg.solve(poses[:-1], poses[1:])


def _angle_deg(motions: Tensor) -> Tensor:
    """Rotation angle; unlike acos of the trace alone, exact near 0 and 180 degrees."""
    rotation = motions[:, :3, :3]
    turned = rotation - rotation.mT
    sine = torch.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], -1).norm(dim=-1)
    cosine = rotation.diagonal(dim1=-2, dim2=-1).sum(-1) - 1
    return torch.rad2deg(torch.atan2(sine, cosine))


def _require_rigid(poses: Tensor, what: str) -> None:
    rotation = poses.detach()[:, :3, :3].double()
    identity = torch.eye(3, dtype=torch.float64, device=poses.device)
    error = float((rotation @ rotation.mT - identity).abs().amax())
    # Negated, so that NaN is refused.
    if not (error <= RIGID and bool(poses.isfinite().all())):
        raise InputError(f"{what}: expected finite rotations without scale or shear, got others")
    if bool((torch.linalg.det(rotation) < 0).any()):
        raise InputError(f"{what}: expected right-handed rotations, got a mirrored axis")


def _root_mean_square(values: Tensor) -> float:
    return math.sqrt(float(values.square().mean()))
