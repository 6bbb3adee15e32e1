"""The true image at some pixels, in float64, from the formula of docs/reference/rendering.md.

Axes: ``n`` Gaussians nearest first, ``p`` pixels, ``k`` contributions to a pixel. Every Gaussian is
asked at every pixel: no support, no tiles, no early end. alpha = min(0.999, o exp(-q / 2)) with
q = dᵀ C⁻¹ d, and 0 below 1/255; rgb = Σ w c, w_i = alpha_i Π_{j<i} (1 - alpha_j). Nothing of the
renderers under test is used but the harmonics.

Gradients: contributions found without autograd are evaluated again with it, a chunk of pixels at a
time, down to what lies on the image; that is carried back through the projection once, at the
end. What alpha cuts off has no gradient, so nothing is lost, and memory is bounded.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

DILATION_PX2, CUTOFF, LARGEST, NEAR = 0.3, 1 / 255, 0.999, 0.01
DOUBT = 1e-3
"""Relative distance of an alpha from the cutoff at which rounding may decide."""
LEAST_LIGHT = 1e-4
"""Where renderers stop; a pair behind less light than this counts as not blended."""
_CHUNK = 400_000
"""Entries of one dense matrix of pixels and Gaussians; a dozen of them live at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Splats:
    """Gaussians on the image."""

    center: Float[Tensor, "n 2"]
    precision: Float[Tensor, "n 3"]
    """(xx, xy, yy) of the inverse covariance."""
    opacity: Float[Tensor, " n"]
    color: Float[Tensor, "n 3"]

    def tensors(self) -> list[Tensor]:
        """Its tensors, in order."""
        return [getattr(self, field.name) for field in fields(self)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """What is true at some pixels."""

    rgb: Float[Tensor, "p 3"]
    doubtful: Bool[Tensor, " p"]
    """Some alpha lies within ``DOUBT`` of the cutoff."""
    blended: Int[Tensor, " p"]
    """Contributions at or above the cutoff, in front of which ``LEAST_LIGHT`` is left."""


@dataclass(frozen=True, slots=True)
class _Contributions:
    """For each pixel the Gaussians that reach the cutoff, nearest first, padded."""

    xy: Float[Tensor, "p 2"]
    members: Int[Tensor, "p k"]
    present: Bool[Tensor, "p k"]
    doubtful: Bool[Tensor, " p"]


@torch.no_grad()
def look(gaussians: Gaussians, camera: Camera, pixels: Int[Tensor, " p"]) -> Pixels:
    """The true colours of ``pixels``, row-major indices into the image."""
    splats = project(gaussians.to(torch.float64), camera.to(torch.float64))
    parts = []
    for chunk in _chunks(splats, camera, pixels):
        alpha, light = _alpha_light(splats, chunk)
        blended = (alpha > 0) & (light >= LEAST_LIGHT)
        parts.append((_blend(splats, chunk, alpha * light), chunk.doubtful, blended.sum(1)))
    rgb, doubtful, blended = (torch.cat(part) for part in zip(*parts, strict=True))
    return Pixels(rgb=rgb, doubtful=doubtful, blended=blended)


def gradients(
    gaussians: Gaussians, camera: Camera, pixels: Int[Tensor, " p"], grad: Float[Tensor, "p 3"]
) -> Gaussians:
    """Gradient of Σ rgb · grad over ``pixels`` in every parameter, float64."""
    names = [field.name for field in fields(gaussians)]
    leaves = [getattr(gaussians, name).detach().double().requires_grad_() for name in names]
    exact = Gaussians(**dict(zip(names, leaves, strict=True)))
    projected = project(exact, camera.to(torch.float64)).tensors()
    flat = [tensor.detach().requires_grad_() for tensor in projected]
    splats = Splats(**{f.name: part for f, part in zip(fields(Splats), flat, strict=True)})
    done = 0
    for chunk in _chunks(splats, camera, pixels):
        alpha, light = _alpha_light(splats, chunk)
        rgb = _blend(splats, chunk, alpha * light)
        rgb.backward(grad[done : done + len(rgb)].double())
        done += len(rgb)
    sums = [torch.zeros_like(part) if part.grad is None else part.grad for part in flat]
    found = torch.autograd.grad(projected, leaves, sums, materialize_grads=True)
    return Gaussians(**dict(zip(names, found, strict=True)))


def project(gaussians: Gaussians, camera: Camera) -> Splats:
    """Footprints of the Gaussians in front of the near plane, nearest first, ties by index."""
    rotation, position = camera.world_from_camera[:3, :3], camera.position
    z = ((gaussians.means.detach() - position) @ rotation)[:, 2]
    order = z.argsort(stable=True)
    seen = gaussians.select(order[z[order] > NEAR])
    x, y, z = ((seen.means - position) @ rotation).unbind(-1)
    (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
    height, width = camera.size_px
    tan_x = torch.clamp(x / z, (-0.15 * width - cx) / fx, (1.15 * width - cx) / fx)
    tan_y = torch.clamp(y / z, (-0.15 * height - cy) / fy, (1.15 * height - cy) / fy)
    root = rotation.mT @ _rotations(seen.quats) @ torch.diag_embed(seen.scales)
    row_x = (fx / z)[:, None] * (root[:, 0] - tan_x[:, None] * root[:, 2])
    row_y = (fy / z)[:, None] * (root[:, 1] - tan_y[:, None] * root[:, 2])
    xx, yy = (row.square().sum(-1) + DILATION_PX2 for row in (row_x, row_y))
    xy = (row_x * row_y).sum(-1)
    toward = seen.means - position
    return Splats(
        center=torch.stack([fx * x / z + cx, fy * y / z + cy], -1),
        precision=torch.stack([yy, -xy, xx], -1) / (xx * yy - xy * xy)[:, None],
        opacity=seen.opacities,
        color=harmonics.color(seen.sh, toward / toward.norm(dim=-1, keepdim=True)),
    )


def _rotations(quats: Float[Tensor, "n 4"]) -> Float[Tensor, "n 3 3"]:
    w, x, y, z = (quats / quats.norm(dim=-1, keepdim=True)).unbind(-1)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return torch.stack(entries, -1).unflatten(-1, (3, 3))


def _chunks(splats: Splats, camera: Camera, pixels: Int[Tensor, " p"]) -> Iterator[_Contributions]:
    width, count = camera.size_px[1], len(splats.opacity)
    for part in pixels.split(max(1, _CHUNK // max(1, count))):
        xy = torch.stack([part % width, part // width], -1).double() + 0.5
        yield _contributions(splats, xy)


@torch.no_grad()
def _contributions(splats: Splats, xy: Float[Tensor, "p 2"]) -> _Contributions:
    """Ask every Gaussian at every pixel, and keep what reaches the cutoff."""
    response = _response(xy, splats.center, splats.precision, splats.opacity)
    reaching = response >= CUTOFF
    # Padding repeats Gaussian 0, which is there because something reaches.
    counts = reaching.sum(1)
    members = torch.zeros(len(xy), int(counts.max()) if len(xy) else 0, dtype=torch.long)
    present = torch.arange(members.shape[1]) < counts[:, None]
    members[present] = reaching.nonzero()[:, 1]
    doubtful = ((response / CUTOFF - 1).abs() < DOUBT).any(1)
    return _Contributions(xy, members, present, doubtful)


def _response(
    xy: Float[Tensor, "p 2"],
    center: Float[Tensor, "*p k 2"],
    precision: Float[Tensor, "*p k 3"],
    opacity: Float[Tensor, "*p k"],
) -> Float[Tensor, "p k"]:
    """o exp(-q / 2) at each pixel, of the same Gaussians or of its own."""
    dx, dy = (xy[:, axis, None] - center[..., axis] for axis in (0, 1))
    power = precision[..., 0] * dx * dx + precision[..., 2] * dy * dy
    power = power + 2 * precision[..., 1] * dx * dy
    return opacity * torch.exp(-0.5 * power)


def _alpha_light(
    splats: Splats, chunk: _Contributions
) -> tuple[Float[Tensor, "p k"], Float[Tensor, "p k"]]:
    """What each contribution covers, and the light that arrives at it."""
    own = [part[chunk.members] for part in (splats.center, splats.precision, splats.opacity)]
    alpha = torch.where(chunk.present, _response(chunk.xy, *own).clamp_max(LARGEST), 0.0)
    passed = torch.cumprod(1 - alpha, 1)
    return alpha, torch.cat([torch.ones_like(passed[:, :1]), passed[:, :-1]], 1)


def _blend(
    splats: Splats, chunk: _Contributions, weight: Float[Tensor, "p k"]
) -> Float[Tensor, "p 3"]:
    return (weight[..., None] * splats.color[chunk.members]).sum(1)
