"""Gaussians on the image: elliptical weighted averaging (Zwicker et al. 2001; Kerbl et al. 2023).

Axes: ``n`` Gaussians. A Gaussian with covariance Σ = (R S)(R S)ᵀ and camera-space mean (x, y, z)
has the footprint covariance M Mᵀ + d I with M = J W R S, where W turns world into camera axes, d is
the dilation and J = diag(f_x, f_y) / z · [1 0 -x/z; 0 1 -y/z]. In J alone, x/z and y/z are held to
the image plus 15 % of its size on each side: the linearisation is useless beyond.

The covariance is never formed as such. With rows a, b of M its determinant is
|a × b|² + d (|a|² + |b|²) + d², a sum of positive terms that does not cancel for needles, and the
Mahalanobis distance is q = u² + v² with u = Δx / σ_x and v = (Δy - slope Δx) / σ_y|x.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

GUARD_BAND = 0.15
"""How far beyond the image J follows the mean, in image sizes: to 1.3 tan(fov / 2)."""


TOO_LARGE = 1e31
"""Numbers of cameras and rays from which products overflow in float32."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprints:
    """Gaussians as they fall on the image."""

    center_px: Float[Tensor, "n 2"]
    depth: Float[Tensor, " n"]
    """z of the mean."""
    sigma_px: Float[Tensor, "n 2"]
    """Standard deviations along x and along y."""
    whitening: Float[Tensor, "n 3"]
    """(1 / sigma_x, slope, 1 / sigma_y|x): what makes (dx, dy) a pair of standard normals."""
    opacities: Float[Tensor, " n"]
    """At the centre, after the compensation for dilation where that is asked for."""


def camera_space(camera: Camera, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Camera coordinates of world points."""
    # Subtracting first is exact where camera and scene share a large offset; Rx + t is not.
    return (points - camera.position) @ camera.world_from_camera[:3, :3]


def to_pixels(camera: Camera, local: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
    """Pixel coordinates of camera-space points with z ≠ 0."""
    return camera.focal_px * local[:, :2] / local[:, 2:] + camera.center_px


def pixels_in_front(
    camera: Camera, points: Float[Tensor, "n 3"], near_depth: float
) -> tuple[Float[Tensor, "n 2"], Float[Tensor, " n"], Bool[Tensor, "n 1"]]:
    """Pixels and z of world points beyond ``near_depth``, and which points that are.

    The others have any finite numbers: where a number overflows, its gradient is NaN even if the
    number is not used.
    """
    usable = _below_limit(points)
    local = camera_space(camera, torch.where(usable, points, 0.0))
    front = usable & (local[:, 2:] > near_depth)
    local = torch.where(front, local, 1.0)
    front = front & _below_limit(to_pixels(camera, local.detach()))
    return to_pixels(camera, torch.where(front, local, 1.0)), local[:, 2], front


def _below_limit(values: Float[Tensor, "n d"]) -> Bool[Tensor, "n 1"]:
    return (values.detach().abs() < largest_number(values)).all(-1, keepdim=True)


def largest_number(values: Tensor) -> float:
    """The first one whose square overflows in the arithmetic of ``values``."""
    return torch.finfo(values.dtype).max ** 0.5


def footprints(gaussians: Gaussians, camera: Camera, settings: RenderSettings) -> Footprints:
    """Footprints of Gaussians in front of the camera."""
    local = camera_space(camera, gaussians.means)
    root = _covariance_root(gaussians, camera, local)
    # All lengths in units of the largest entry, so that no square over- or underflows.
    size = root.detach().abs().amax((1, 2)).clamp_min(max(settings.added_px2, 1e-30) ** 0.5)
    row_x, row_y = (root / size[:, None, None]).unbind(1)
    dilation = (settings.added_px2**0.5 / size).square()
    area = torch.linalg.cross(row_x, row_y)
    spread_x, spread_y = row_x.square().sum(-1), row_y.square().sum(-1)
    determinant = area.square().sum(-1) + dilation * (spread_x + spread_y + dilation)
    sigma_x, sigma_y = (spread_x + dilation).sqrt(), (spread_y + dilation).sqrt()
    kept_light = torch.linalg.vector_norm(area, dim=-1) / determinant.sqrt()
    return Footprints(
        center_px=to_pixels(camera, local),
        depth=local[:, 2],
        sigma_px=torch.stack([sigma_x, sigma_y], -1) * size[:, None],
        whitening=torch.stack(
            [
                1 / (sigma_x * size),
                (row_x * row_y).sum(-1) / (spread_x + dilation),
                sigma_x / determinant.sqrt() / size,
            ],
            -1,
        ),
        opacities=gaussians.opacities * kept_light if settings.antialias else gaussians.opacities,
    )


def _covariance_root(
    gaussians: Gaussians, camera: Camera, local: Float[Tensor, "n 3"]
) -> Float[Tensor, "n 2 3"]:
    """M = J W R S, a square root of the footprint covariance."""
    axes = camera.world_from_camera[:3, :3].mT @ quaternion.to_matrix(gaussians.quats)
    axes = axes * gaussians.scales[:, None, :]
    depth = local[:, 2:]
    width_height = camera.center_px.new_tensor([camera.size_px[1], camera.size_px[0]])
    lowest = (-GUARD_BAND * width_height - camera.center_px) / camera.focal_px
    highest = ((1 + GUARD_BAND) * width_height - camera.center_px) / camera.focal_px
    tangent = torch.clamp(local[:, :2] / depth, lowest, highest)
    return (axes[:, :2] - tangent[..., None] * axes[:, 2:]) * (camera.focal_px / depth)[..., None]
