"""The seeded cloud of Gaussians that the checks of cameras and Gaussians begin with."""

import torch

from diff4splat.geometry.camera import Camera, focal_from_fov, pinhole
from diff4splat.scene.gaussians import Gaussians

SIZE_PX = (36, 48)
FOV_DEG = 60.0
DISTANCE = 4.0
"""From the camera at the origin to the middle of the cloud, in scene units."""
COUNT = 200


def cloud(count: int = COUNT) -> Gaussians:
    """Coloured Gaussians of many shapes in a ball of radius 1, with view-dependent colour."""
    generator = torch.Generator().manual_seed(11)
    directions = torch.randn(count, 3, generator=generator)
    radii = torch.rand(count, 1, generator=generator) ** (1 / 3)
    means = radii * directions / directions.norm(dim=1, keepdim=True)
    return Gaussians(
        means=means + torch.tensor([0.0, 0.0, DISTANCE]),
        quats=torch.randn(count, 4, generator=generator),
        scales=0.02 + 0.1 * torch.rand(count, 3, generator=generator),
        opacities=0.1 + 0.85 * torch.rand(count, generator=generator),
        sh=0.4 * torch.randn(count, 4, 3, generator=generator),
    )


def camera(fov_deg: float = FOV_DEG) -> Camera:
    """At the origin, looking at the cloud."""
    return pinhole(focal_from_fov(fov_deg, SIZE_PX[1]), SIZE_PX)
