"""Images of Gaussians pixel by pixel in float64, from the formula, and scenes to try it on.

No tiles, no support, no whitening: every Gaussian is asked at every pixel, with the inverse of its
covariance. ``doubtful`` marks pixels where a decision (cutoff, half the light) hangs on rounding.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

C0, C1 = 0.28209479177387814, 0.4886025119029199
BAND = 1e-3


@dataclass
class Oracle:
    """Images, and where not to look."""

    rgb: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray
    median_depth: np.ndarray
    doubtful: np.ndarray


def rotation(quat: np.ndarray) -> np.ndarray:
    w, x, y, z = quat / np.linalg.norm(quat)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def footprint(mean, quat, scale, camera: Camera, dilation: float):
    """(pixel, z, covariance without dilation, covariance) of one Gaussian."""
    pose = camera.world_from_camera.numpy().astype(np.float64)
    fx, fy = camera.focal_px.tolist()
    cx, cy = camera.center_px.tolist()
    height, width = camera.size_px
    x, y, z = pose[:3, :3].T @ (mean - pose[:3, 3])
    tx = np.clip(x / z, (-0.15 * width - cx) / fx, (1.15 * width - cx) / fx)
    ty = np.clip(y / z, (-0.15 * height - cy) / fy, (1.15 * height - cy) / fy)
    jacobian = np.array([[fx / z, 0, -fx * tx / z], [0, fy / z, -fy * ty / z]])
    to_camera = jacobian @ pose[:3, :3].T @ rotation(quat)
    bare = to_camera @ np.diag(scale**2) @ to_camera.T
    return np.array([fx * x / z + cx, fy * y / z + cy]), z, bare, bare + dilation * np.eye(2)


def color(sh: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Degrees 0 and 1."""
    x, y, z = direction / np.linalg.norm(direction)
    values = np.array([C0, -C1 * y, C1 * z, -C1 * x])[: len(sh)]
    return np.maximum(0.5 + values @ sh, 0)


def brute_force(gaussians: Gaussians, camera: Camera, settings: RenderSettings) -> Oracle:
    """The image by two nested loops."""
    arrays = [
        getattr(gaussians, name).detach().numpy().astype(np.float64)
        for name in ("means", "quats", "scales", "opacities", "sh")
    ]
    eye = camera.world_from_camera.numpy()[:3, 3].astype(np.float64)
    splats = []
    for mean, quat, scale, opacity, sh in zip(*arrays, strict=True):
        pixel, z, bare, covariance = footprint(mean, quat, scale, camera, settings.added_px2)
        if z <= settings.near_depth:
            continue
        kept = np.sqrt(np.linalg.det(bare) / np.linalg.det(covariance)) if settings.antialias else 1
        splats.append((z, pixel, np.linalg.inv(covariance), opacity * kept, color(sh, mean - eye)))
    splats.sort(key=lambda splat: splat[0])
    height, width = camera.size_px
    out = Oracle(*(np.zeros((height, width, *tail)) for tail in ((3,), (), (), (), ())))
    for row in range(height):
        for column in range(width):
            _pixel(out, row, column, splats, settings)
    return out


def _pixel(out: Oracle, row: int, column: int, splats: list, settings: RenderSettings) -> None:
    light, rgb, depth = 1.0, np.zeros(3), 0.0
    for z, pixel, precision, opacity, rgb_of_splat in splats:
        delta = np.array([column + 0.5, row + 0.5]) - pixel
        alpha = min(opacity * np.exp(-0.5 * delta @ precision @ delta), settings.alpha_max)
        out.doubtful[row, column] += abs(alpha / settings.alpha_cutoff - 1) < BAND
        if alpha < settings.alpha_cutoff:
            continue
        rgb, depth = rgb + light * alpha * rgb_of_splat, depth + light * alpha * z
        if light > 0.5 >= light * (1 - alpha):
            out.median_depth[row, column] = z
        light *= 1 - alpha
        out.doubtful[row, column] += abs(light - 0.5) < BAND
    out.rgb[row, column] = rgb + light * np.array(settings.background)
    out.alpha[row, column] = 1 - light
    out.depth[row, column] = depth / (1 - light) if light < 1 else 0.0


def assert_close_to_oracle(
    actual: Tensor, oracle: np.ndarray, doubtful: np.ndarray, terms: int
) -> None:
    """``terms`` sums of size one may each round once; nobody types a tolerance."""
    sure = doubtful == 0
    assert sure.mean() > 0.8, "the scene leaves too little to compare"
    scale = max(1.0, float(np.abs(oracle).max()))
    tolerance = 4.0 * torch.finfo(actual.dtype).eps * terms * scale
    np.testing.assert_allclose(
        actual.detach().double().numpy()[sure], oracle[sure], rtol=0.0, atol=tolerance
    )


def random_gaussians(count: int, seed: int = 0, bands: int = 4, dtype=torch.float64) -> Gaussians:
    """A cloud in front of the camera at the origin, some of it off the image."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator, dtype=torch.float64)

    depth = uniform(count, 1, low=1.5, high=4.0)
    return Gaussians(
        means=torch.cat([uniform(count, 2, low=-0.7, high=0.7) * depth, depth], 1),
        quats=torch.randn(count, 4, generator=generator, dtype=torch.float64),
        scales=uniform(count, 3, low=0.03, high=0.4),
        opacities=uniform(count, low=0.1, high=0.95),
        sh=uniform(count, bands, 3, low=-0.5, high=0.9),
    ).to(dtype)


def small_camera(size_px: tuple[int, int] = (13, 17), dtype=torch.float64) -> Camera:
    """Nothing at its default: odd size, two focal lengths, shifted centre, moved and turned."""
    camera = pinhole(14.0, size_px, dtype)
    angle = torch.tensor(0.1, dtype=dtype)
    pose = torch.eye(4, dtype=dtype)
    pose[0, 0], pose[0, 2], pose[2, 0], pose[2, 2] = (
        angle.cos(),
        angle.sin(),
        -angle.sin(),
        angle.cos(),
    )
    pose[:3, 3] = torch.tensor([0.1, -0.2, -0.3], dtype=dtype)
    return Camera(
        focal_px=camera.focal_px * camera.focal_px.new_tensor([1.0, 1.2]),
        center_px=camera.center_px + camera.center_px.new_tensor([1.5, -0.7]),
        world_from_camera=pose,
        size_px=size_px,
    )
