"""The obvious loop in PyTorch: what one writes in an afternoon, and what many projects ship.

For every 16×16 tile: the Gaussians whose 3-sigma box touches it, nearest first, a dense
(pixels × Gaussians) matrix of alphas, a cumulative product, autograd for the backward pass.
Footprints as in docs/reference/rendering.md.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch_backward import TorchPrepared

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

NAME = "tile-loop"
NOTE = "footprints end at 3 sigma; largest alpha 0.999"
TILE_PX, DILATION_PX2, CUTOFF, LARGEST = 16, 0.3, 1 / 255, 0.999


@dataclass(frozen=True, slots=True)
class Splats:
    """Gaussians on the image, nearest first."""

    center: Float[Tensor, "n 2"]
    conic: Float[Tensor, "n 3"]
    radius: Float[Tensor, "n 2"]
    opacity: Float[Tensor, " n"]
    color: Float[Tensor, "n 3"]


def unavailable() -> str | None:
    """It needs PyTorch only."""


def prepare(gaussians: Gaussians, camera: Camera) -> TorchPrepared:
    """Nothing to convert."""
    return TorchPrepared(gaussians=gaussians, draw=lambda these: draw(these, camera))


def draw(gaussians: Gaussians, camera: Camera) -> Float[Tensor, "h w 3"]:
    """The image, tile by tile."""
    splats = project(gaussians, camera)
    height, width = camera.size_px
    bands = [
        torch.cat([tile(splats, top, left, camera) for left in range(0, width, TILE_PX)], 1)
        for top in range(0, height, TILE_PX)
    ]
    return torch.cat(bands, 0)


def project(gaussians: Gaussians, camera: Camera) -> Splats:
    """Footprints of the Gaussians in front of the camera."""
    to_camera = camera.camera_from_world
    local = gaussians.means @ to_camera[:3, :3].mT + to_camera[:3, 3]
    order = local.detach()[:, 2].argsort(stable=True)
    order = order[local.detach()[order, 2] > 0.01]
    local, seen = local[order], gaussians.select(order)
    x, y, z = local.unbind(-1)
    (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
    height, width = camera.size_px
    tan_x = (x / z).clamp((-0.15 * width - cx) / fx, (1.15 * width - cx) / fx)
    tan_y = (y / z).clamp((-0.15 * height - cy) / fy, (1.15 * height - cy) / fy)
    zero = torch.zeros_like(z)
    jacobian = torch.stack([fx / z, zero, -fx * tan_x / z, zero, fy / z, -fy * tan_y / z], -1)
    axes = to_camera[:3, :3] @ quaternion.to_matrix(seen.quats) * seen.scales[:, None]
    root = jacobian.unflatten(-1, (2, 3)) @ axes
    covariance = root @ root.mT + DILATION_PX2 * torch.eye(2)
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    directions = torch.nn.functional.normalize(seen.means - camera.position, dim=-1)
    return Splats(
        center=torch.stack([fx * x / z + cx, fy * y / z + cy], -1),
        conic=torch.stack([c, -b, a], -1) / (a * c - b * b)[:, None],
        radius=3 * torch.stack([a, c], -1).detach().sqrt(),
        opacity=seen.opacities,
        color=harmonics.color(seen.sh, directions),
    )


def tile(splats: Splats, top: int, left: int, camera: Camera) -> Float[Tensor, "rows columns 3"]:
    """One tile of the image."""
    rows = torch.arange(top, min(top + TILE_PX, camera.size_px[0])) + 0.5
    columns = torch.arange(left, min(left + TILE_PX, camera.size_px[1])) + 0.5
    nearest, farthest = splats.center - splats.radius, splats.center + splats.radius
    touching = (
        (farthest[:, 0] > left)
        & (nearest[:, 0] < left + TILE_PX)
        & (farthest[:, 1] > top)
        & (nearest[:, 1] < top + TILE_PX)
    ).nonzero()[:, 0]
    center, conic = splats.center[touching], splats.conic[touching]
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    dx, dy = x.flatten()[:, None] - center[:, 0], y.flatten()[:, None] - center[:, 1]
    power = conic[:, 0] * dx * dx + 2 * conic[:, 1] * dx * dy + conic[:, 2] * dy * dy
    alpha = (splats.opacity[touching] * torch.exp(-0.5 * power)).clamp_max(LARGEST)
    alpha = torch.where(alpha >= CUTOFF, alpha, 0.0)
    passed = torch.cumprod(1 - alpha, 1)
    light = torch.cat([torch.ones_like(passed[:, :1]), passed[:, :-1]], 1)
    return ((alpha * light) @ splats.color[touching]).unflatten(0, x.shape)
