"""Photographs of a scene in float64, ray by ray, and small scenes to photograph.

Every ray is written from the formulas: pixel centre, lens, point on the aperture, focal point, time
of the line and of the exposure. The scene is asked for its state at the time of that one ray, which
`oracles_trace` then follows in a loop over Gaussians.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import oracles_io
import torch
from oracles_render import C0
from oracles_trace import brute_force
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

F32, F64 = torch.float32, torch.float64
SHARP = PhotoSettings(smoothing_px2=0.0)


def dots(
    means: list[tuple[float, float, float]],
    scale: float = 0.01,
    opacity: float = 0.9,
    rgb: tuple[float, float, float] = (1.0, 1.0, 1.0),
    dtype: torch.dtype = F32,
) -> Gaussians:
    """Round Gaussians of one colour."""
    count = len(means)
    return Gaussians(
        means=torch.tensor(means, dtype=dtype).view(count, 3),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], dtype=dtype).repeat(count, 1),
        scales=torch.full((count, 3), scale, dtype=dtype),
        opacities=torch.full((count,), opacity, dtype=dtype),
        sh=((torch.tensor(rgb, dtype=dtype) - 0.5) / C0).expand(count, 1, 3).clone(),
    )


def scene_of(gaussians: Gaussians, motion: Motion | None = None) -> Scene:
    """A scene with any path."""
    return replace(
        oracles_io.scene(), gaussians=gaussians, motion=StaticMotion() if motion is None else motion
    )


def drifting(
    gaussians: Gaussians,
    velocity: tuple[float, float, float],
    time_range_s: tuple[float, float] = (-10.0, 10.0),
    center_s: float = 0.0,
    deviation_s: float = math.inf,
) -> Scene:
    """All of ``gaussians`` at one velocity; they are where they are at ``center_s``."""
    count = len(gaussians)
    like = gaussians.means
    motion = SpacetimeMotion(
        moving_index=torch.arange(count),
        velocities=like.new_tensor(velocity).expand(count, 3).clone(),
        time_centers_s=like.new_full((count,), center_s),
        time_deviations_s=like.new_full((count,), deviation_s),
        time_range_s=time_range_s,
    )
    return scene_of(gaussians, motion)


def keyed(
    gaussians: Gaussians,
    times_s: list[float],
    offsets: Tensor,
    turns: Tensor | None = None,
    stretches: Tensor | None = None,
    interpolation: str = "linear",
) -> Scene:
    """All of ``gaussians`` with offsets ``t n 3`` at key times."""
    like = gaussians.means
    lead = tuple(offsets.shape[:2])
    still = torch.eye(4, dtype=like.dtype)[0].expand(*lead, 4).clone()
    motion = KeyframeMotion(
        key_times_s=like.new_tensor(times_s),
        moving_index=torch.arange(len(gaussians)),
        offsets=offsets.to(like),
        rotations=still if turns is None else turns.to(like),
        log_scale_offsets=like.new_zeros(*lead, 3) if stretches is None else stretches.to(like),
        interpolation=interpolation,
    )
    return scene_of(gaussians, motion)


def shot(
    subject: Scene | Gaussians,
    camera: Camera,
    optics: Optics | None = None,
    settings: PhotoSettings = SHARP,
    time_s: float = 0.0,
    outputs: tuple[str, ...] = ("rgb", "alpha"),
    **others: object,
) -> Photograph:
    """A photograph with little to write."""
    backend = others.pop("backend", "auto")
    own = PhysicalCamera(camera=camera, optics=optics or Optics(), **others)
    return photograph(subject, own, time_s, outputs=outputs, settings=settings, backend=backend)


def camera_of(
    size_px: tuple[int, int] = (33, 41), focal_px: float = 100.0, dtype: torch.dtype = F32
) -> Camera:
    return pinhole(focal_px, size_px, dtype)


@dataclass
class Spot:
    """Mass, centre and covariance of an image, in pixels (x, y)."""

    mass: float
    center: np.ndarray
    covariance: np.ndarray


def spot(image: Tensor) -> Spot:
    weights = image.detach().double().numpy()
    rows, columns = np.indices(weights.shape) + 0.5
    mass = weights.sum()
    center = np.array([(weights * columns).sum(), (weights * rows).sum()]) / mass
    away = np.stack([columns - center[0], rows - center[1]])
    covariance = np.einsum("ihw,jhw,hw->ij", away, away, weights) / mass
    return Spot(mass, center, covariance)


def row_centers(image: Tensor) -> np.ndarray:
    """Centre of mass of every row, x in pixels."""
    weights = image.detach().double().numpy()
    columns = np.arange(weights.shape[1]) + 0.5
    return (weights * columns).sum(1) / weights.sum(1)


@dataclass(frozen=True, kw_only=True)
class Ideal:
    """What the loop over rays needs to know, in plain numbers."""

    radius: float = 0.0
    focus: float = 1.0
    sphere: bool = False
    readout_s: float = 0.0
    direction: str = "top-to-bottom"
    exposure_s: float = 0.0
    starts: bool = False
    fisheye: tuple[float, ...] | None = None
    """OpenCV's coefficients; None is a pinhole."""


def line_share(row: int, column: int, size_px: tuple[int, int], direction: str) -> float:
    """Share of the read-out at which a pixel is read."""
    height, width = size_px
    line, count = {
        "top-to-bottom": (row, height),
        "bottom-to-top": (height - 1 - row, height),
        "left-to-right": (column, width),
        "right-to-left": (width - 1 - column, width),
    }[direction]
    return 0.5 if count == 1 else line / (count - 1)


def lens_direction(x: float, y: float, ideal: Ideal) -> np.ndarray:
    """Unit direction in camera axes; the fisheye's angle by bisection."""
    if ideal.fisheye is None:
        ray = np.array([x, y, 1.0])
        return ray / np.linalg.norm(ray)
    wanted, low, high = math.hypot(x, y), 0.0, math.pi
    k = ideal.fisheye
    for _ in range(80):
        t = 0.5 * (low + high)
        value = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8)
        low, high = (t, high) if value < wanted else (low, t)
    if wanted == 0:
        return np.array([0.0, 0.0, 1.0])
    return np.array([x / wanted * math.sin(t), y / wanted * math.sin(t), math.cos(t)])


def ray_time(row: int, column: int, size_px: tuple[int, int], part: float, ideal: Ideal) -> float:
    """Of the sample ``part`` of the exposure, relative to the frame."""
    anchor = 0.0 if ideal.starts else 0.5
    share = line_share(row, column, size_px, ideal.direction)
    return (share - anchor) * ideal.readout_s + (part - anchor) * ideal.exposure_s


def aperture_ray(
    direction: np.ndarray, on_lens: np.ndarray, ideal: Ideal
) -> tuple[np.ndarray, np.ndarray]:
    """Origin and unit direction in camera axes."""
    reach = ideal.focus if ideal.sphere else ideal.focus / direction[2]
    start = np.array([*(ideal.radius * on_lens), 0.0])
    ahead = reach * direction - start
    return start, ahead / np.linalg.norm(ahead)


def brute_photograph(
    scene: Scene,
    camera: Camera,
    ideal: Ideal,
    draws: dict[str, np.ndarray],
    time_s: float,
    settings: PhotoSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """(rgb ``h w 3``, where every sample is sure ``h w``) by loops over pixels and samples.

    ``draws`` holds ``lens`` (p s 2), ``pixel`` (p s 2) and ``exposure`` (p s), each or none.
    """
    height, width = camera.size_px
    samples = max((d.shape[1] for d in draws.values()), default=1)
    rgb, sure = np.zeros((height, width, 3)), np.ones((height, width), dtype=bool)
    focal, center = camera.focal_px.double().numpy(), camera.center_px.double().numpy()
    pose = camera.world_from_camera.double().numpy()
    for row in range(height):
        for column in range(width):
            flat = row * width + column
            for s in range(samples):
                shift = draws["pixel"][flat, s] if "pixel" in draws else np.zeros(2)
                point = np.array([column + 0.5, row + 0.5]) + shift
                direction = lens_direction(*((point - center) / focal), ideal)
                start = np.zeros(3)
                if "lens" in draws:
                    start, direction = aperture_ray(direction, draws["lens"][flat, s], ideal)
                part = draws["exposure"][flat, s] if "exposure" in draws else 0.5
                offset = ray_time(row, column, camera.size_px, part, ideal)
                rays = Rays(
                    origins=torch.from_numpy(pose[:3, :3] @ start + pose[:3, 3])[None],
                    directions=torch.from_numpy(pose[:3, :3] @ direction)[None],
                )
                seen = brute_force(scene.state_at(time_s + offset), rays, settings.trace)
                rgb[row, column] += seen.rgb[0] / samples
                sure[row, column] &= seen.unsure[0] == 0
    return rgb, sure
