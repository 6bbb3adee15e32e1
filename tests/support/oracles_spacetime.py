"""Native 4D Gaussians in float64 from the 4 × 4 covariance, and small ones for the tests of files.

Numpy, one Gaussian at a time: the rotation from its two 4 × 4 matrices, the slice by the Schur
complement, harmonics of order n by their cosine. Nothing of the package is asked for a value.

The committed scene file is made again, after a deliberate change of the format, by:
    PYTHONPATH=tests/support python -c "import oracles_spacetime; oracles_spacetime.write_golden()"
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import oracles_io
import torch

from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.spacetime_conversion import SpacetimeGaussians
from diff4splat.scene.motion.spacetime_covariance import SpacetimeCovariance
from diff4splat.scene.scene import Scene

GOLDEN = Path(__file__).parents[1] / "golden" / "scene_v1_spacetime.safetensors"
F64 = torch.float64


@dataclass(frozen=True, kw_only=True)
class Slice:
    """One Gaussian at one time."""

    mean: np.ndarray
    covariance: np.ndarray
    pulse: float
    """Before any gate."""


def rotation(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """J (L M) J of two quaternions."""
    a, b, c, d = left / np.linalg.norm(left)
    p, q, r, s = right / np.linalg.norm(right)
    first = np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])
    second = np.array([[p, q, r, s], [-q, p, -s, r], [-r, s, p, -q], [-s, -r, q, p]])
    return (first @ second)[::-1, ::-1]


def covariance(shape: SpacetimeCovariance, row: int) -> np.ndarray:
    """Σ = R diag(s²) Rᵀ of one Gaussian."""
    turn = rotation(shape.left_quats[row].double().numpy(), shape.right_quats[row].double().numpy())
    return turn @ np.diag(shape.scales[row].double().numpy() ** 2) @ turn.T


def slice_at(mean: np.ndarray, sigma: np.ndarray, time_s: float) -> Slice:
    """Conditional mean and covariance of space given time, and exp(−½ dt² / Σ_tt)."""
    elapsed, variance = time_s - mean[3], sigma[3, 3]
    return Slice(
        mean=mean[:3] + sigma[:3, 3] / variance * elapsed,
        covariance=sigma[:3, :3] - np.outer(sigma[:3, 3], sigma[3, :3]) / variance,
        pulse=math.exp(-0.5 * elapsed**2 / variance),
    )


def harmonics_at(orders: np.ndarray, elapsed: float, period_s: float) -> np.ndarray:
    """Σ_n cos(2π n dt / T) · order n, from (o, k, 3)."""
    return sum(
        math.cos(2 * math.pi * n * elapsed / period_s) * order for n, order in enumerate(orders)
    )


def largest_on_ray(
    mean: np.ndarray, inverse: np.ndarray, ray: tuple[np.ndarray, np.ndarray], time_s: float
) -> float:
    """The largest exp(−½ xᵀ Σ⁻¹ x) that a ray meets in space-time at one time."""
    start = np.append(ray[0], time_s) - mean
    direction = np.append(ray[1], 0.0)
    nearest = start - direction * (start @ inverse @ direction) / (direction @ inverse @ direction)
    return math.exp(-0.5 * nearest @ inverse @ nearest)


def normal(*shape: int, seed: int) -> torch.Tensor:
    """Normal numbers of a seed."""
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=F64)


def primitives(count: int, seed: int = 0, orders: int = 3, bands: int = 4) -> SpacetimeGaussians:
    """Native 4D Gaussians of moderate shapes, turned in any way."""
    return SpacetimeGaussians(
        covariance=SpacetimeCovariance(
            means=normal(count, 4, seed=seed),
            scales=(0.7 * normal(count, 4, seed=seed + 1)).exp(),
            left_quats=normal(count, 4, seed=seed + 2),
            right_quats=normal(count, 4, seed=seed + 3),
        ),
        opacities=normal(count, seed=seed + 4).sigmoid(),
        orders=normal(count, orders, bands, 3, seed=seed + 5),
    )


def still_gaussians(count: int, bands: int = 4, seed: int = 0) -> Gaussians:
    """Canonical Gaussians of a seed."""
    return Gaussians(
        means=normal(count, 3, seed=seed + 10),
        quats=torch.nn.functional.normalize(normal(count, 4, seed=seed + 11), dim=-1),
        scales=(0.5 * normal(count, 3, seed=seed + 12)).exp(),
        opacities=normal(count, seed=seed + 13).sigmoid(),
        sh=normal(count, bands, 3, seed=seed + 14),
    )


def motion(index: list[int], seed: int = 0, waves: int = 2, bands: int = 4) -> SpacetimeMotion:
    """Pulses of every length over two seconds; no colour waves where ``waves`` is 0."""
    count = len(index)
    return SpacetimeMotion(
        moving_index=torch.tensor(index, dtype=torch.long),
        velocities=normal(count, 3, seed=seed + 20),
        time_centers_s=1 + normal(count, seed=seed + 21),
        time_deviations_s=normal(count, seed=seed + 22).exp(),
        time_range_s=(0.0, 2.0),
        color_waves=normal(count, waves, bands, 3, seed=seed + 23) if waves else None,
        period_s=1.7,
    )


def file_motion(dtype: torch.dtype = torch.float32) -> SpacetimeMotion:
    """Gaussians 1 and 3 of ``oracles_io.scene``; the second one is always there."""
    return SpacetimeMotion(
        moving_index=torch.tensor([1, 3]),
        velocities=oracles_io.ramp(2, 3, dtype=dtype) - 0.0625,
        time_centers_s=torch.tensor([0.5, 1.25], dtype=dtype),
        time_deviations_s=torch.tensor([0.25, math.inf], dtype=dtype),
        time_range_s=(0.0, 2.0),
        color_waves=oracles_io.ramp(2, 2, 4, 3, dtype=dtype) - 0.25,
        period_s=2.0,
        gate=0.05,
    )


def file_scene(dtype: torch.dtype = torch.float32) -> Scene:
    """Four Gaussians and all that a scene file can hold of this motion."""
    return replace(oracles_io.scene(dtype=dtype), motion=file_motion(dtype))


def write_golden() -> None:
    """Make the committed scene file again."""
    save_scene(file_scene(), GOLDEN)
