"""Centre and scale of a scene, from the training cameras.

Axes: ``f`` frames. Lengths in scene units.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.geometry.camera import Camera

MIN_EXTENT_SHARE = 0.25
"""Smallest extent as a share of the distance, for cameras that hardly move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneBounds:
    """Centre and lengths that scale learning rates and initial points."""

    center: Float[Tensor, "3"]
    """The point nearest to all optical axes."""
    distance: float
    """Mean distance of the cameras from the centre."""
    extent: float
    """1.1 times the largest distance of a camera from their mean (Kerbl et al. 2023), at least
    ``MIN_EXTENT_SHARE`` of ``distance``."""


def scene_bounds(capture: Capture) -> SceneBounds:
    """Bounds of the scene that the training cameras look at."""
    cameras = capture.cameras[capture.learnt]
    position = cameras.position.double()
    center = nearest_point_to_axes(cameras)
    distance = float((position - center).norm(dim=-1).mean())
    spread = 1.1 * float((position - position.mean(0)).norm(dim=-1).max())
    extent = max(spread, MIN_EXTENT_SHARE * distance, 1e-9)
    return SceneBounds(center=center.float(), distance=max(distance, 1e-9), extent=extent)


def nearest_point_to_axes(cameras: Camera) -> Float[Tensor, "3"]:
    """Σ_f (I − a aᵀ)(x − p) = 0, solved for x: the point nearest to all optical axes.

    Parallel axes have no solution. A weak prior one baseline in front of the cameras keeps x
    finite.
    """
    pose = cameras.world_from_camera.double()
    axis, position = pose[:, :3, 2], pose[:, :3, 3]
    projector = torch.eye(3, dtype=torch.float64) - axis[:, :, None] * axis[:, None, :]
    spread = float((position - position.mean(0)).norm(dim=-1).max())
    prior = position.mean(0) + max(spread, 1.0) * torch.nn.functional.normalize(axis.mean(0), dim=0)
    weight = 1e-3 * torch.eye(3, dtype=torch.float64)
    right = (projector @ position[:, :, None]).mean(0)[:, 0] + weight @ prior
    return torch.linalg.solve(projector.mean(0) + weight, right)
