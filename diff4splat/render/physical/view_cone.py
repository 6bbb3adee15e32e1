"""A camera reduced to its position, a cone around its view, and pixels per radian.

Axes: ``n`` Gaussians.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.scene.gaussians import Gaussians

FAINTEST = 1 / 255
"""Opacity below which nothing is rendered."""
_MAX_EDGE_RATIO = 4
"""Largest ratio of pixels per radian at the edge of an image to those in its middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewCone:
    """Position, cone and angular resolution of a camera."""

    position: Float[Tensor, "3"]
    ahead: Float[Tensor, "3"]
    least_cosine: float
    """Between ``ahead`` and any direction inside the image."""
    pixels_per_radian: float
    """In the middle of the image."""
    most_pixels_per_radian: float
    """The largest in the image, as at the edge of a pinhole image."""

    def contains(self, gaussians: Gaussians) -> Bool[Tensor, " n"]:
        """Whether the mean is in the cone, or the Gaussian is large next to its distance."""
        away = gaussians.means - self.position
        distance = away.norm(dim=-1)
        ahead = (away @ self.ahead) >= self.least_cosine * distance
        near = distance < 3 * gaussians.scales.amax(-1)
        return (ahead | near) & (gaussians.opacities >= FAINTEST)

    def pixels(self, lengths: Float[Tensor, " n"], gaussians: Gaussians) -> Float[Tensor, " n"]:
        """Size in pixels of ``lengths`` at the Gaussians, for any orientation.

        A Gaussian around the camera has no visible edge: it counts as one deviation away.
        """
        away = gaussians.means - self.position
        turned = (quaternion.to_matrix(gaussians.quats).mT @ away[..., None]).squeeze(-1)
        tiny = torch.finfo(away.dtype).tiny
        deviations = (turned / gaussians.scales.clamp_min(tiny)).norm(dim=-1)
        distance = away.norm(dim=-1) / deviations.clamp(tiny, 1.0)
        distance = torch.where(deviations > tiny, distance, gaussians.scales.amax(-1))
        return self.most_pixels_per_radian * lengths / distance


@torch.no_grad()
def view_cone(camera: PhysicalCamera, time_s: float) -> ViewCone:
    """The cone of ``camera`` at ``time_s``."""
    pose = camera.camera.world_from_camera
    if camera.track is not None:
        pose = camera.track.at(torch.tensor([time_s], dtype=torch.float64))[0].to(pose)
    around_middle = 1 / radians_per_pixel(camera.camera, camera.optics)
    return ViewCone(
        position=pose[:3, 3],
        ahead=pose[:3, 2],
        least_cosine=_least_cosine(camera.camera, camera.optics),
        pixels_per_radian=around_middle,
        most_pixels_per_radian=max(around_middle, _max_pixels_per_radian(camera, around_middle)),
    )


@torch.no_grad()
def radians_per_pixel(camera: Camera, optics: Optics) -> float:
    """Angle of a step along a row in the middle of the image, else at the principal point."""
    height, width = camera.size_px
    middles = torch.stack([camera.center_px.new_tensor([width / 2, height / 2]), camera.center_px])
    step = camera.center_px.new_tensor([0.5, 0.0])
    for middle in middles:
        ends = torch.stack([middle - step, middle + step])
        directions, exist = optics.lens.directions((ends - camera.center_px) / camera.focal_px)
        if bool(exist.all()):
            # The chord is exact where the cosine is rounded to 1.
            chord = float((directions[1].double() - directions[0].double()).norm())
            return 2 * math.asin(min(chord / 2, 1.0))
    return float(1 / camera.focal_px[0])


def _max_pixels_per_radian(camera: PhysicalCamera, around_middle: float) -> float:
    """Pixels per radian where a step to the right or down turns a ray least.

    At the poles of a sphere a step does not turn the ray at all, so there is a limit.
    """
    own = camera.camera
    # In float64: a step is small.
    focal_px, center_px = own.focal_px.double(), own.center_px.double()
    lens = camera.optics.lens.to(torch.float64)
    steps = 0.5 * torch.eye(2, dtype=torch.float64, device=focal_px.device)
    positions = _grid(own).double()[:, None]
    ends = torch.stack([positions - steps, positions + steps])
    directions, exist = lens.directions((ends - center_px) / focal_px)
    chords = (directions[1] - directions[0]).norm(dim=-1)[exist.all(0)]
    least = chords.clamp_min(1 / (_MAX_EDGE_RATIO * around_middle))
    return float(1 / least.min()) if len(least) else around_middle


def _grid(camera: Camera) -> Float[Tensor, "g 2"]:
    """A grid of positions in the image, its edge included."""
    height, width = camera.size_px
    rows = torch.linspace(0, height, 17, dtype=camera.focal_px.dtype)
    columns = torch.linspace(0, width, 17, dtype=camera.focal_px.dtype)
    positions = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1).flatten(0, 1)
    return positions.to(camera.focal_px.device)


def _least_cosine(camera: Camera, optics: Optics) -> float:
    """Over the edge of the image and a grid inside, with a tenth of a radian to spare."""
    directions, exist = optics.lens.directions((_grid(camera) - camera.center_px) / camera.focal_px)
    if not bool(exist.any()):
        return 1.0
    widest = math.acos(max(-1.0, min(1.0, float(directions[exist][:, 2].min()))))
    return math.cos(min(widest + 0.1, math.pi))
