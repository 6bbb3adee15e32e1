"""Where the scene is: the place that the cameras look at, and how large things are there.

Axes: ``f`` frames. Lengths in scene units.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.geometry.camera import Camera

SMALLEST_SHARE = 0.25
"""Of the distance to what is looked at: cameras that hardly move do not make a tiny scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """What learning rates and bounds are measured in."""

    center: Float[Tensor, "3"]
    """Where the optical axes come closest to each other."""
    distance: float
    """From the cameras to the centre, on average."""
    extent: float
    """1.1 times the largest distance of a camera from their mean (Kerbl et al. 2023), but never
    less than ``SMALLEST_SHARE`` of ``distance``."""


def find_region(capture: Capture) -> Region:
    """The region that the training frames look at."""
    cameras = capture.cameras[capture.learnt]
    position = cameras.position.double()
    center = meeting_point(cameras)
    distance = float((position - center).norm(dim=-1).mean())
    spread = 1.1 * float((position - position.mean(0)).norm(dim=-1).max())
    extent = max(spread, SMALLEST_SHARE * distance, 1e-9)
    return Region(center=center.float(), distance=max(distance, 1e-9), extent=extent)


def meeting_point(cameras: Camera) -> Float[Tensor, "3"]:
    """Σ_f (I − a aᵀ)(x − p) = 0, solved for x: the point nearest to all optical axes.

    Parallel axes meet nowhere; a small pull towards one baseline in front keeps x finite.
    """
    pose = cameras.world_from_camera.double()
    axis, position = pose[:, :3, 2], pose[:, :3, 3]
    across = torch.eye(3, dtype=torch.float64) - axis[:, :, None] * axis[:, None, :]
    spread = float((position - position.mean(0)).norm(dim=-1).max())
    ahead = position.mean(0) + max(spread, 1.0) * torch.nn.functional.normalize(axis.mean(0), dim=0)
    pull = 1e-3 * torch.eye(3, dtype=torch.float64)
    right = (across @ position[:, :, None]).mean(0)[:, 0] + pull @ ahead
    return torch.linalg.solve(across.mean(0) + pull, right)
