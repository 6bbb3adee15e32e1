"""Mitsuba 3 as an independent tracer, and on which rays its rules and ours are the same.

Mitsuba's ``ellipsoids`` with ``volprim_rf_basic`` (BSD) blend the value at the peak along the ray,
as we do, but in the order in which rays enter the ellipsoid of three standard deviations. It goes
on 1e-4 behind each entry, and its entries are less exact than that: some ellipsoids are met twice,
others are jumped over. So ``comparable`` takes rays, before anything is drawn, on which Mitsuba's
search for ellipsoids finds those that float64 finds, once each and in the order of their peaks.
Lengths are some tens of units, where most of its entries are exact enough. Shell:
(x - μ)ᵀ Σ⁻¹ (x - μ) = 9, entered at τ - h with h² = (9 - D²) / (dᵀ Σ⁻¹ d).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from oracles_trace import as_array, covariance
from torch import Tensor

from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

VERSION = "3.7.1"
SHELL_SQUARED = 9.0
RESTART = 1e-4
"""How far behind an entry Mitsuba goes on."""
NEAR = 1e-3
MARGIN = 1e-3
"""Of D² and of the light that ends a ray, where float32 may decide either way."""
RULES = TraceSettings(
    alpha_cutoff=1e-9,
    alpha_max=0.9999,
    light_cutoff=0.01,
    min_response=float(np.exp(-SHELL_SQUARED / 2)),
    near_distance=NEAR,
)
"""What Mitsuba does, in our settings."""


def loaded(gaussians: Gaussians) -> Any:
    """Mitsuba's scene; quaternions are xyzw there."""
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    columns = {
        "centers": gaussians.means,
        "scales": gaussians.scales,
        "quaternions": torch.nn.functional.normalize(gaussians.quats, dim=-1).roll(-1, -1),
        "opacities": gaussians.opacities[:, None],
        "sh_coeffs": gaussians.sh.flatten(1),
    }
    shape = {name: mitsuba.TensorXf(part.contiguous().numpy()) for name, part in columns.items()}
    return mitsuba.load_dict({"type": "scene", "cloud": {"type": "ellipsoids", **shape}})


def lines(rays: Rays) -> Any:
    """Mitsuba's rays."""
    import mitsuba

    origins, directions = rays.origins.T.contiguous(), rays.directions.T.contiguous()
    return mitsuba.Ray3f(mitsuba.Point3f(origins.numpy()), mitsuba.Vector3f(directions.numpy()))


def traced(gaussians: Gaussians, rays: Rays) -> Tensor:
    """RGB of every ray by Mitsuba."""
    import drjit
    import mitsuba

    scene = loaded(gaussians)
    rules = {"type": "volprim_rf_basic", "max_depth": -1, "srgb_primitives": False}
    sampler = mitsuba.load_dict({"type": "independent"})
    integrator, mode = mitsuba.load_dict(rules), drjit.ADMode.Primal
    radiance = integrator.sample(mode, scene, sampler, lines(rays), None, None, True)[0]
    return torch.from_numpy(radiance.numpy().copy()).T.contiguous()


def visits(gaussians: Gaussians, rays: Rays) -> list[list[int]]:
    """Which ellipsoids Mitsuba's integrator will meet on every ray, one after another."""
    scene, line = loaded(gaussians), lines(rays)
    met: list[list[int]] = [[] for _ in range(len(rays))]
    for _ in range(4 * len(gaussians)):
        found = scene.ray_intersect(line)
        valid = np.isfinite(found.t.numpy())
        if not valid.any():
            break
        index = found.prim_index.numpy()
        for i in np.flatnonzero(valid):
            met[i].append(int(index[i]))
        line.o[found.is_valid()] = found.p + line.d * RESTART
    return met


@dataclass
class Meetings:
    """Where every ray meets every Gaussian: (r, n) each."""

    tau: np.ndarray
    squared: np.ndarray
    entry: np.ndarray
    alpha: np.ndarray

    def inside(self) -> np.ndarray:
        """Which shells are entered in front of the origin."""
        return (self.squared < SHELL_SQUARED) & (self.entry > 0)


def meetings(gaussians: Gaussians, rays: Rays) -> Meetings:
    """All pairs, from covariances."""
    means, quats, scales = (as_array(getattr(gaussians, n)) for n in ("means", "quats", "scales"))
    shapes = [covariance(quat, scale) for quat, scale in zip(quats, scales, strict=True)]
    precision = np.linalg.inv(np.stack(shapes))
    origins, directions = as_array(rays.origins), as_array(rays.directions)
    offset = means[None] - origins[:, None]
    bent = np.einsum("nij,rj->rni", precision, directions)
    steep = np.einsum("rni,ri->rn", bent, directions)
    tau = np.einsum("rni,rni->rn", bent, offset) / steep
    away = tau[..., None] * directions[:, None] - offset
    squared = np.einsum("rni,nij,rnj->rn", away, precision, away)
    return Meetings(
        tau=tau,
        squared=squared,
        entry=tau - np.sqrt(np.maximum(SHELL_SQUARED - squared, 0) / steep),
        alpha=np.minimum(as_array(gaussians.opacities) * np.exp(-squared / 2), RULES.alpha_max),
    )


def comparable(gaussians: Gaussians, rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(r,) rays that see anything; of them those in one order by both rules; those to compare."""
    met, found = meetings(gaussians, rays), visits(gaussians, rays)
    seen = (met.squared < SHELL_SQUARED) & (met.tau > NEAR)
    ordered = seen.any(1) & (np.abs(met.squared - SHELL_SQUARED) > MARGIN).all(1)
    ordered &= (seen == met.inside()).all(1)
    chosen = ordered.copy()
    for i in np.flatnonzero(ordered):
        members = np.flatnonzero(seen[i])
        members = members[np.argsort(met.tau[i, members])]
        left = np.cumprod(1 - met.alpha[i, members])
        ordered[i] = bool((np.diff(met.entry[i, members]) > 0).all())
        sure = bool((np.abs(left / RULES.light_cutoff - 1) > MARGIN).all())
        chosen[i] = ordered[i] and sure and found[i] == members.tolist()
    return seen.any(1), ordered, chosen


def shells(seed: int, bands: int, layers: int = 8, edge: int = 6) -> Gaussians:
    """Gaussians whose order is the same by any rule, for rays from the origin.

    Each lies in a cell of its own of a layer between two spheres around the origin: those that one
    ray meets lie in different layers.
    """
    generator = torch.Generator().manual_seed(seed)
    count = layers * edge * edge

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    index = torch.arange(count)
    layer, row, column = index // edge**2, index // edge % edge, index % edge
    middle = 20.0 + 9.0 * layer + uniform(count, low=-0.5, high=0.5)
    pitch = 1.0 / edge
    # A Gaussian reaches no further than half of its cell, and than half of its layer.
    slope = (torch.stack([row, column], 1) + 0.5) * pitch - 0.5
    toward = torch.cat([slope, torch.ones(count, 1)], 1)
    toward = torch.nn.functional.normalize(toward, dim=1)
    largest = (0.48 * pitch * middle * toward[:, 2] ** 2).clamp(max=4.0) / 3
    return Gaussians(
        means=middle[:, None] * toward,
        quats=torch.randn(count, 4, generator=generator),
        scales=largest[:, None] * uniform(count, 3, low=0.4, high=1.0),
        opacities=uniform(count, low=0.05, high=1.0),
        sh=uniform(count, bands, 3, low=-0.6, high=0.9),
    )


def crowd(seed: int, bands: int, count: int = 400) -> Gaussians:
    """A cloud in front of the origin, elongated up to three times, overlapping in depth."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    depth = uniform(count, 1, low=15.0, high=50.0)
    return Gaussians(
        means=torch.cat([uniform(count, 2, low=-0.5, high=0.5) * depth, depth], 1),
        quats=torch.randn(count, 4, generator=generator),
        scales=uniform(count, 1, low=0.3, high=0.9) * uniform(count, 3, low=0.4, high=1.0),
        opacities=uniform(count, low=0.05, high=1.0),
        sh=uniform(count, bands, 3, low=-0.6, high=0.9),
    )


def forward_rays(seed: int, count: int, spread: float) -> Rays:
    """Float32 rays from near the origin into a field of view of 53 degrees."""
    generator = torch.Generator().manual_seed(seed)
    slope = torch.rand(count, 2, generator=generator) - 0.5
    return Rays(
        origins=spread * torch.randn(count, 3, generator=generator),
        directions=torch.cat([slope, torch.ones(count, 1)], 1),
    )
