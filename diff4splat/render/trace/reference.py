"""Brute force in plain PyTorch: every ray against every Gaussian, with gradients by autograd.

Axes: ``r`` rays of a chunk, ``n`` Gaussians, ``p`` pairs (ray, Gaussian) that see each other, ``k``
places in the longest list of a chunk. Per ray, over its pairs by (τ, index):

    α = min(α_max, o · response), 0 below the cutoff      w_i = α_i Π_{j<i} (1 - α_j)

Pairs are found without gradients, chunk by chunk, and blended again with them. Everything is
float64 inside.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.response import closest, exponent, whitening
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

_BYTES_PER_MEETING = 512
"""Of a ray and a Gaussian that are only asked whether they see each other."""
_BYTES_PER_PAIR = 2048
"""Of a pair that is blended, with its way back."""
_OUTPUT_COLUMNS = 8
"""Columns of what a ray sees: rgb (3), Σ w τ, Σ w, light left, median τ, hits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RayOutputs:
    """Outputs per ray, before the background."""

    rgb: Float[Tensor, "r 3"]
    distance_sum: Float[Tensor, " r"]
    """Σ w τ"""
    weight: Float[Tensor, " r"]
    """Σ w"""
    light: Float[Tensor, " r"]
    """Transmittance: the share of light from behind all hits."""
    median: Float[Tensor, " r"]
    hits: Int[Tensor, " r"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scene:
    """Gaussians as all rays use them."""

    gaussians: Gaussians
    whiten: Float[Tensor, "n 3 3"]
    moving: MovingCloud | None
    settings: TraceSettings


def trace_reference(
    gaussians: Gaussians, rays: Rays, settings: TraceSettings, moving: MovingCloud | None
) -> RayOutputs:
    """Outputs along valid ``rays`` through valid ``gaussians``."""
    scene = _Scene(
        gaussians=gaussians.to(torch.float64),
        whiten=whitening(gaussians),
        moving=None if moving is None else _double(moving),
        settings=settings,
    )
    rays64 = _double(rays)
    table = torch.cat(list(_tables(scene, rays64))).to(gaussians.means.dtype)
    return RayOutputs(
        rgb=table[:, :3],
        distance_sum=table[:, 3],
        weight=table[:, 4],
        light=table[:, 5],
        median=table[:, 6],
        hits=table[:, 7].detach().long(),
    )


def _double(parts: Rays | MovingCloud) -> Rays | MovingCloud:
    tensors = {f.name: getattr(parts, f.name) for f in fields(parts)}
    numbers = {
        name: value.double()
        for name, value in tensors.items()
        if isinstance(value, Tensor) and value.is_floating_point()
    }
    return replace(parts, **numbers)


def _tables(scene: _Scene, rays: Rays) -> Iterator[Float[Tensor, "r 8"]]:
    """What one group of rays after another sees."""
    remember = torch.is_grad_enabled()
    for chunk in _slices(len(rays), scene):
        own = rays.select(chunk)
        ray, member, distance = _intersections(scene, own)
        counts = torch.bincount(ray, minlength=len(own))
        for group in _groups(counts.tolist(), scene.settings.memory_bytes // _BYTES_PER_PAIR):
            mask = (ray >= group.start) & (ray < group.stop)
            lists = _nearest_first(ray[mask] - group.start, member[mask], distance[mask])
            part, longest = own.select(group), max(counts[group].tolist(), default=0)
            if remember:
                yield checkpoint(
                    _blend,
                    scene,
                    part,
                    *lists,
                    longest,
                    use_reentrant=False,
                    preserve_rng_state=False,
                )
            else:
                yield _blend(scene, part, *lists, longest)


def _slices(count: int, scene: _Scene) -> Iterator[slice]:
    per_ray = max(1, len(scene.gaussians)) * _BYTES_PER_MEETING
    size = max(1, scene.settings.memory_bytes // per_ray)
    # Without rays there is one empty chunk, which keeps the graph together.
    return (slice(first, min(first + size, count)) for first in range(0, max(count, 1), size))


def _groups(counts: list[int], limit: int) -> Iterator[slice]:
    """Runs of rays with few enough pairs, padding to the longest list included."""
    first, longest = 0, 0
    for index, count in enumerate(counts):
        longest = max(longest, count)
        if index > first and (index - first + 1) * longest > limit:
            yield slice(first, index)
            first, longest = index, count
    yield slice(first, len(counts))


@torch.no_grad()
def _intersections(
    scene: _Scene, rays: Rays
) -> tuple[Int[Tensor, " p"], Int[Tensor, " p"], Float[Tensor, " p"]]:
    """(ray, Gaussian, τ) of all pairs that see each other."""
    device = rays.origins.device
    everyone = torch.arange(len(scene.gaussians), device=device)[None]
    distance, _, seen = _responses(
        scene, rays, torch.arange(len(rays), device=device)[:, None], everyone
    )
    ray, member = seen.nonzero().unbind(1)
    return ray, member, distance[ray, member]


def _responses(
    scene: _Scene, rays: Rays, ray: Int[Tensor, "*#p"], member: Int[Tensor, "*#p"]
) -> tuple[Float[Tensor, "*p"], Float[Tensor, "*p"], Bool[Tensor, "*p"]]:
    """τ, α and whether the ray sees the Gaussian at all; indices of one size or of a table."""
    settings, cloud = scene.settings, scene.gaussians
    mean, shine = _at_time(scene, rays, ray, member)
    distance, squared = closest(
        scene.whiten[member], rays.origins[ray] - mean, rays.directions[ray]
    )
    response = exponent(squared, settings)
    alpha = cloud.opacities[member] * (response + shine).exp()
    seen = (alpha >= settings.alpha_cutoff) & (distance > settings.near_distance)
    if settings.min_response is not None:
        seen = seen & (response >= math.log(settings.min_response))
    return distance, alpha.clamp(max=settings.alpha_max), seen


def _at_time(
    scene: _Scene, rays: Rays, ray: Int[Tensor, "*#p"], member: Int[Tensor, "*#p"]
) -> tuple[Float[Tensor, "*#p 3"], Float[Tensor, "*#p"]]:
    """Means when the rays look, and the logarithms of the pulses; minus infinity is dark."""
    mean, moving = scene.gaussians.means[member], scene.moving
    if moving is None:
        return mean, mean.new_zeros(())
    since = rays.time_s[ray] - moving.time_centers_s[member]
    late = since / moving.time_deviations_s[member]
    shine = torch.where(late.abs() < moving.gate_reach, -0.5 * late.square(), -torch.inf)
    return mean + moving.velocities[member] * since[..., None], shine


def _nearest_first(
    ray: Int[Tensor, " p"], member: Int[Tensor, " p"], distance: Float[Tensor, " p"]
) -> tuple[Int[Tensor, " p"], Int[Tensor, " p"]]:
    """Pairs by (ray, τ, index); they come by (ray, index)."""
    order = distance.argsort(stable=True)
    order = order[ray[order].argsort(stable=True)]
    return ray[order], member[order]


def _blend(
    scene: _Scene, rays: Rays, ray: Int[Tensor, " p"], member: Int[Tensor, " p"], longest: int
) -> Float[Tensor, "r 8"]:
    """Front to back, until less light is left than the cutoff."""
    distance, alpha, _ = _responses(scene, rays, ray, member)
    first = torch.searchsorted(ray, torch.arange(len(rays), device=ray.device))
    place = torch.arange(len(ray), device=ray.device) - first[ray]
    padded = alpha.new_zeros(len(rays), longest).index_put((ray, place), alpha)
    reached = _before(1 - padded.detach()) >= scene.settings.dark
    padded = torch.where(reached, padded, 0.0)
    before = _before(1 - padded)
    weight, after = (padded * before)[ray, place], (before * (1 - padded))
    halved = ((before > 0.5) & (after <= 0.5))[ray, place]
    hit = (padded > 0)[ray, place]
    columns = [_colors(scene, rays, ray, member) * weight[:, None]]
    columns += [(weight * distance)[:, None], weight[:, None], torch.zeros_like(weight)[:, None]]
    columns += [torch.where(halved, distance, 0.0)[:, None], hit.to(weight)[:, None]]
    table = alpha.new_zeros(len(rays), _OUTPUT_COLUMNS).index_add(0, ray, torch.cat(columns, 1))
    light = after[:, -1] if longest else torch.ones_like(table[:, 0])
    return torch.cat([table[:, :5], light[:, None], table[:, 6:]], 1)


def _before(passing: Float[Tensor, "r k"]) -> Float[Tensor, "r k"]:
    """Product over the nearer ones."""
    return torch.cat([torch.ones_like(passing[:, :1]), passing], 1).cumprod(1)[:, :-1]


def _colors(
    scene: _Scene, rays: Rays, ray: Int[Tensor, " p"], member: Int[Tensor, " p"]
) -> Float[Tensor, "p 3"]:
    direction = rays.directions[ray]
    if scene.settings.color_direction == "mean":
        toward = _at_time(scene, rays, ray, member)[0] - rays.origins[ray]
        direction = torch.nn.functional.normalize(toward, dim=1)
    return harmonics.color(scene.gaussians.sh[member], direction)
