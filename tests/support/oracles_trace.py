"""What single rays see, in float64 loops from the formula, and scenes to try it on.

No canonical space: a Gaussian is the inverse of its covariance, and a ray meets it where the
density along the ray peaks, τ = dᵀ Σ⁻¹ (μ - o) / dᵀ Σ⁻¹ d. ``unsure`` rays hang on rounding.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from oracles_render import C0, C1, rotation
from torch import Tensor

from diff4splat.render.trace.api import trace
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

ANSWERS = ("rgb", "distance", "median_distance", "alpha", "hits")
PARAMETERS = ("means", "quats", "scales", "opacities", "sh")
MOTION = ("velocities", "time_centers_s", "time_deviations_s")
BAND = 2e-4


@dataclass
class Oracle:
    """What every ray sees, and where not to look."""

    rgb: np.ndarray
    distance: np.ndarray
    median_distance: np.ndarray
    alpha: np.ndarray
    hits: np.ndarray
    light: np.ndarray
    unsure: np.ndarray


def covariance(quat: np.ndarray, scale: np.ndarray) -> np.ndarray:
    turn = rotation(quat) if np.any(quat) else np.eye(3)
    return turn @ np.diag(scale**2) @ turn.T


def peak(mean, sigma, origin, direction) -> tuple[float, float]:
    """(τ, D²) where the density along the ray is largest."""
    precision = np.linalg.inv(sigma)
    tau = direction @ precision @ (mean - origin) / (direction @ precision @ direction)
    away = origin + tau * direction - mean
    return tau, away @ precision @ away


def response(squared: float, degree: int) -> float:
    return math.exp(-0.5 * squared) if degree == 2 else math.exp(-(squared**2) / 18)


def color(sh: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Degrees 0 and 1."""
    x, y, z = direction / np.linalg.norm(direction)
    values = np.array([C0, -C1 * y, C1 * z, -C1 * x])[: len(sh)]
    return np.maximum(0.5 + values @ sh, 0)


def brute_force(
    gaussians: Gaussians, rays: Rays, settings: TraceSettings, moving: MovingCloud | None = None
) -> Oracle:
    """Two nested loops."""
    cloud = [as_array(getattr(gaussians, name)) for name in PARAMETERS]
    motion = None if moving is None else [as_array(getattr(moving, name)) for name in MOTION]
    count = len(rays)
    out = Oracle(*(np.zeros((count, *tail)) for tail in ((3,), (), (), (), (), (), ())))
    for i in range(count):
        origin, direction = as_array(rays.origins)[i], as_array(rays.directions)[i]
        time_s = 0.0 if rays.time_s is None else float(rays.time_s[i])
        hits = []
        for j, (rest, quat, scale, strength, sh) in enumerate(zip(*cloud, strict=True)):
            mean, opacity = rest, strength
            if motion is not None:
                since = time_s - motion[1][j]
                mean, pulse = (
                    mean + motion[0][j] * since,
                    math.exp(-0.5 * (since / motion[2][j]) ** 2),
                )
                opacity = opacity * pulse if pulse > moving.gate else 0.0
                out.unsure[i] += abs(pulse - moving.gate) < BAND
            tau, squared = peak(mean, covariance(quat, scale), origin, direction)
            seen = response(squared, settings.kernel_degree)
            alpha = opacity * seen
            out.unsure[i] += abs(alpha / settings.alpha_cutoff - 1) < BAND
            out.unsure[i] += abs(tau - settings.near_distance) < BAND
            if settings.min_response is not None:
                out.unsure[i] += abs(seen / settings.min_response - 1) < BAND
            strong = settings.min_response is None or seen >= settings.min_response
            if alpha >= settings.alpha_cutoff and tau > settings.near_distance and strong:
                toward = direction if settings.color_direction == "ray" else mean - origin
                hits.append((tau, j, min(alpha, settings.alpha_max), color(sh, toward)))
        blend(out, i, sorted(hits, key=lambda hit: hit[:2]), settings)
    return out


def blend(out: Oracle, i: int, hits: list, settings: TraceSettings) -> None:
    light = 1.0
    for k, (tau, _, alpha, rgb) in enumerate(hits):
        if light < settings.light_cutoff * (1 + 1e-4):
            break
        if k:
            out.unsure[i] += abs(tau - hits[k - 1][0]) < 1e-6 * tau
        weight = light * alpha
        out.rgb[i] += weight * rgb
        out.distance[i] += weight * tau
        out.alpha[i] += weight
        out.hits[i] += 1
        if light > 0.5 >= light * (1 - alpha):
            out.median_distance[i] = tau
        light *= 1 - alpha
        out.unsure[i] += abs(light - 0.5) < BAND or abs(light / settings.light_cutoff - 1) < BAND
    out.light[i] = light
    out.rgb[i] += light * np.array(settings.background)
    out.distance[i] /= max(out.alpha[i], 1e-300)


def as_array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().double().numpy()


def assert_as_the_oracle(
    got, want: Oracle, tolerance: float, names: tuple[str, ...] = ANSWERS
) -> None:
    """Every answer of the rays that are sure, next to the size of what is answered."""
    sure = want.unsure == 0
    assert sure.mean() > 0.8, "the scene leaves too little to compare"
    for name in names:
        answer = getattr(want, name)[sure]
        room = tolerance * max(1.0, float(np.abs(answer).max(initial=0.0)))
        np.testing.assert_allclose(as_array(getattr(got, name))[sure], answer, rtol=0, atol=room)


def scene(count: int = 40, seed: int = 0, bands: int = 4, dtype=torch.float64) -> Gaussians:
    """A cloud all around the origin, of any opacity, elongated up to ten times."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator, dtype=torch.float64)

    return Gaussians(
        means=uniform(count, 3, low=-3.0, high=3.0),
        quats=torch.randn(count, 4, generator=generator, dtype=torch.float64),
        scales=10 ** uniform(count, 3, low=-1.0, high=0.0),
        opacities=uniform(count, low=0.0, high=1.0),
        sh=uniform(count, bands, 3, low=-0.5, high=0.9),
    ).to(dtype)


def bundle(count: int = 50, seed: int = 1, dtype=torch.float64, times: bool = False) -> Rays:
    """Rays from places around the origin in all directions."""
    generator = torch.Generator().manual_seed(seed)
    numbers = torch.randn(2, count, 3, generator=generator, dtype=torch.float64)
    when = torch.rand(count, generator=generator, dtype=torch.float64)
    return Rays(
        origins=(0.3 * numbers[0]).to(dtype),
        directions=numbers[1].to(dtype),
        time_s=when.to(dtype) if times else None,
    )


def image(
    size_px: tuple[int, int], focal_px: float, dtype=torch.float64, spread: float = 0.0
) -> Rays:
    """Rays of a pinhole at the origin that looks along z, row by row; or of a small lens."""
    height, width = size_px
    rows, columns = torch.meshgrid(
        torch.arange(height, dtype=torch.float64) + 0.5,
        torch.arange(width, dtype=torch.float64) + 0.5,
        indexing="ij",
    )
    x, y = (columns - width / 2) / focal_px, (rows - height / 2) / focal_px
    directions = torch.stack([x, y, torch.ones_like(x)], -1).flatten(0, 1)
    generator = torch.Generator().manual_seed(3)
    shift = spread * torch.randn(len(directions), 2, generator=generator, dtype=torch.float64)
    origins = torch.cat([shift, torch.zeros_like(shift[:, :1])], 1)
    # All of a lens looks at one plane.
    return Rays(origins=origins.to(dtype), directions=(3 * directions - origins).to(dtype))


def motion(count: int = 40, seed: int = 5, dtype=torch.float64, **changes: float) -> MovingCloud:
    """Velocities of about one unit per second, pulses around the first second."""
    generator = torch.Generator().manual_seed(seed)
    velocities = torch.randn(count, 3, generator=generator, dtype=torch.float64)
    numbers = torch.rand(2, count, generator=generator, dtype=torch.float64)
    return MovingCloud(
        velocities=velocities.to(dtype),
        time_centers_s=(numbers[0] * 1.4 - 0.2).to(dtype),
        time_deviations_s=(0.2 + numbers[1]).to(dtype),
        **changes,
    )


def sphere(
    mean: tuple[float, float, float] = (0.0, 0.0, 2.0),
    scale: float = 0.1,
    opacity: float = 0.8,
    rgb: tuple[float, float, float] = (1.0, 0.5, 0.25),
    dtype=torch.float64,
) -> Gaussians:
    """One round Gaussian."""
    return Gaussians(
        means=torch.tensor([mean], dtype=dtype),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], dtype=dtype),
        scales=torch.full((1, 3), scale, dtype=dtype),
        opacities=torch.tensor([opacity], dtype=dtype),
        sh=((torch.tensor([[rgb]], dtype=dtype) - 0.5) / C0),
    )


def ray(
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0),
    dtype=torch.float64,
    **others: Tensor,
) -> Rays:
    """One ray."""
    return Rays(
        origins=torch.tensor([origin], dtype=dtype),
        directions=torch.tensor([direction], dtype=dtype),
        **others,
    )


def leaves(parts):
    """A copy of Gaussians or a motion whose numbers collect gradients."""
    own = {f.name: getattr(parts, f.name) for f in fields(parts)}
    fresh = {
        name: value.detach().clone().requires_grad_()
        for name, value in own.items()
        if isinstance(value, Tensor) and value.is_floating_point()
    }
    return replace(parts, **fresh)


def answers(
    gaussians: Gaussians, rays: Rays, moving: MovingCloud | None = None, **settings: object
):
    """Everything that can be asked for, by the reference for float64 and compiled for float32."""
    backend = "reference" if gaussians.means.dtype == torch.float64 else "compiled"
    return trace(
        gaussians, rays, outputs=ANSWERS, settings=TraceSettings(**settings), moving=moving,
        backend=backend,
    )  # fmt: skip
