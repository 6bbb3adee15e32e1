"""Images and gradients in float64, from the formula, by one dense table of Gaussians × pixels.

No tiles, lists or blocks; footprints through a Cholesky factor, gradients by autograd. Unlike the
reference renderer it stops where the light runs out. ``unsure`` pixels hang on rounding: a
contribution at the cutoff, the largest opacity, half the light, or the last of it.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from oracles_render import random_gaussians
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.render.api import render
from diff4splat.render.raster.raster_settings import DEFAULT_LIGHT_CUTOFF
from diff4splat.render.settings import RenderSettings
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

BASE = math.sqrt(0.5 / math.log(2))
BAND = 1e-4
PARAMETERS = ("means", "quats", "scales", "opacities", "sh")
LENS = ("world_from_camera", "focal_px", "center_px")


@dataclass(kw_only=True)
class Dense:
    """What a renderer should answer; None for what was not asked for."""

    rgb: Tensor
    alpha: Tensor
    depth: Tensor
    median_depth: Tensor
    flow: Tensor | None
    features: Tensor | None
    unsure: Tensor
    median_unsure: Tensor

    @property
    def unsure_share(self) -> float:
        """Part of the image that cannot be compared."""
        return float(self.unsure.double().mean())


def rotations(quats: Tensor) -> Tensor:
    """R(q) by Rodrigues' formula; a zero quaternion is the identity."""
    zero = (quats == 0).all(-1, keepdim=True)
    unit = torch.where(zero, quats.new_tensor([1.0, 0, 0, 0]), quats)
    w, x, y, z = torch.nn.functional.normalize(unit, dim=-1).unbind(-1)
    nil = torch.zeros_like(w)
    skew = torch.stack([nil, -z, y, z, nil, -x, -y, x, nil], -1).unflatten(-1, (3, 3))
    return torch.eye(3).to(quats) + 2 * w[:, None, None] * skew + 2 * skew @ skew


def local_means(gaussians: Gaussians, camera: Camera) -> Tensor:
    pose = camera.world_from_camera
    return torch.einsum("ji,nj->ni", pose[:3, :3], gaussians.means - pose[:3, 3])


def shapes(gaussians: Gaussians, camera: Camera, settings: RenderSettings) -> Tensor:
    """Centre (2), whitening of x, shear, whitening of y, log2 of the opacity: (n, 6)."""
    x, y, z = local_means(gaussians, camera).unbind(-1)
    size = camera.focal_px.new_tensor([camera.size_px[1], camera.size_px[0]])
    low = (-0.15 * size - camera.center_px) / camera.focal_px
    high = (1.15 * size - camera.center_px) / camera.focal_px
    tangent = torch.stack([x / z, y / z], -1).clamp(low, high)
    nil, (fx, fy) = torch.zeros_like(z), camera.focal_px
    jacobian = torch.stack(
        [fx / z, nil, -fx * tangent[:, 0] / z, nil, fy / z, -fy * tangent[:, 1] / z], -1
    ).unflatten(-1, (2, 3))
    root = jacobian @ camera.world_from_camera[:3, :3].T @ rotations(gaussians.quats)
    root = root * gaussians.scales[:, None]
    bare = root @ root.mT
    whole = bare + settings.added_px2 * torch.eye(2).to(bare)
    factor = torch.linalg.cholesky(whole)
    first, shear, second = factor[:, 0, 0], factor[:, 1, 0], factor[:, 1, 1]
    opacities = gaussians.opacities
    if settings.antialias:
        opacities = opacities * (torch.linalg.det(bare) / torch.linalg.det(whole)).sqrt()
    columns = [fx * x / z + camera.center_px[0], fy * y / z + camera.center_px[1]]
    columns += [BASE / first, BASE * shear / (first * second), BASE / second, opacities.log2()]
    return torch.stack(columns, -1)


def shape_gradient(shape: Tensor, moments: Tensor) -> Tensor:
    """Gradients of ``shapes`` from sums of ∂/∂ln α times (1, u, u², v, u v, v²).

    By the chain rule on ln α = ln 2 (level - u² - v²), u = a dx, v = b dy - k dx.
    """
    _, _, a, k, b, _ = shape.unbind(-1)
    e, eu, euu, ev, euv, evv = moments.unbind(-1)
    columns = [2 * a * eu - 2 * k * ev, 2 * b * ev, -2 * euu / a, 2 * euv / a]
    # b dy is v + k dx, and dx is u / a.
    columns += [-2 * (evv + k * euv / a) / b, e]
    return math.log(2) * torch.stack(columns, -1)


def responses(shape: Tensor, size_px: tuple[int, int]) -> Tensor:
    """Opacity of every Gaussian at every pixel, before any limit: (n, h, w)."""
    rows, columns = torch.arange(size_px[0]) + 0.5, torch.arange(size_px[1]) + 0.5
    center_x, center_y, whiten_x, shear, whiten_y, level = shape[:, :, None, None].unbind(1)
    dx, dy = columns[None, None] - center_x, rows[None, :, None] - center_y
    return torch.exp2(level - (whiten_x * dx) ** 2 - (whiten_y * dy - shear * dx) ** 2)


def weights(response: Tensor, settings: RenderSettings) -> tuple[Tensor, Tensor, Tensor]:
    """Weight of every Gaussian, nearest first, the light behind each, and unsure pixels."""
    light_cutoff = settings.light_cutoff or DEFAULT_LIGHT_CUTOFF
    alpha = response.clamp(max=settings.alpha_max)
    alpha = torch.where(response >= settings.alpha_cutoff, alpha, 0.0)
    lit = _before(1 - alpha.detach()) >= light_cutoff
    alpha = torch.where(lit, alpha, 0.0)
    before = _before(1 - alpha)
    unsure = lit & _near(response, settings.alpha_cutoff)
    unsure |= lit & _near(response, settings.alpha_max)
    unsure |= _near(before * (1 - alpha), light_cutoff)
    return alpha * before, before * (1 - alpha), unsure.any(0)


def dense(gaussians: Gaussians, camera: Camera, settings: RenderSettings) -> Dense:
    """Everything at once; flow to ``settings.flow_camera``, which sees all Gaussians or none."""
    z = local_means(gaussians, camera)[:, 2]
    # The order is by depth in float32, equal ones by index.
    order = z.detach().float().argsort(stable=True)
    seen = (z[order] > settings.near_depth) & (gaussians.opacities[order] > 0)
    order = order[seen]
    shown, z = gaussians.select(order), z[order]
    weight, light, unsure = weights(
        responses(shapes(shown, camera, settings), camera.size_px), settings
    )
    background = torch.as_tensor(settings.background, dtype=torch.float64)
    left = light[-1] if len(light) else torch.ones(camera.size_px, dtype=torch.float64)
    directions = torch.nn.functional.normalize(
        shown.means - camera.world_from_camera[:3, 3], dim=-1
    )
    rgb = blend(weight, harmonics.color(shown.sh, directions)) + left[..., None] * background
    sides = torch.cat([torch.ones_like(left)[None], light])
    halved = (sides[:-1] > 0.5) & (sides[1:] <= 0.5)
    features = None
    if settings.features is not None:
        features = blend(weight, settings.features[order])
    flow = None
    if settings.flow_camera is not None:
        flow = _mean(weight, _pixels(shown, settings.flow_camera) - _pixels(shown, camera))
    return Dense(
        rgb=rgb,
        alpha=1 - left,
        depth=_mean(weight, z[:, None])[..., 0],
        median_depth=blend(halved.to(z), z[:, None])[..., 0],
        flow=flow,
        features=features,
        unsure=unsure,
        median_unsure=unsure | _near(light, 0.5).any(0),
    )


def blend(weight: Tensor, values: Tensor) -> Tensor:
    """Σ w v: (h, w, c)."""
    return torch.einsum("nhw,nc->hwc", weight, values)


def _mean(weight: Tensor, values: Tensor) -> Tensor:
    total = weight.sum(0)[..., None]
    return blend(weight, values) / torch.where(total > 0, total, 1.0)


def _pixels(gaussians: Gaussians, camera: Camera) -> Tensor:
    local = local_means(gaussians, camera)
    return camera.focal_px * local[:, :2] / local[:, 2:] + camera.center_px


def _before(passing: Tensor) -> Tensor:
    """Product over the nearer ones."""
    return torch.cat([torch.ones_like(passing[:1]), passing]).cumprod(0)[:-1]


def _near(values: Tensor, limit: float) -> Tensor:
    return (values.detach() / limit - 1).abs() < BAND


def psnr_db(got: Tensor, want: Tensor, unsure: Tensor) -> float:
    """Over the pixels that are sure, for values of size one."""
    error = (got.detach().double() - want.detach())[~unsure]
    return -10 * math.log10(max(float(error.square().mean()), 1e-30))


def double(gaussians: Gaussians) -> Gaussians:
    """The same numbers in float64, which collect gradients."""
    return leaves(gaussians.to(torch.float64))


def leaves(gaussians: Gaussians) -> Gaussians:
    """A copy whose parameters collect gradients."""
    own = {f.name: getattr(gaussians, f.name).detach().clone() for f in fields(gaussians)}
    return replace(gaussians, **{name: value.requires_grad_() for name, value in own.items()})


def lens_leaves(camera: Camera, dtype: torch.dtype) -> Camera:
    """A copy whose pose and intrinsics collect gradients."""
    own = {name: getattr(camera, name).detach().to(dtype).clone() for name in LENS}
    return replace(camera, **{name: value.requires_grad_() for name, value in own.items()})


def assert_gradients_agree(got: Tensor, want: Tensor, what: str, tolerance: float = 1e-3) -> None:
    """Length, direction, sum and every element of a gradient."""
    got, want = got.detach().double().flatten(), want.detach().double().flatten()
    assert bool(torch.isfinite(got).all()), f"{what}: not finite"
    size = float(want.norm())
    if size == 0:
        assert not got.any(), f"{what}: expected no gradient"
        return
    off = got - want
    found = {
        "relative L2": float(off.norm()) / size,
        "1 - cosine": 1 - float(got @ want) / (float(got.norm()) * size),
        "bias": abs(float(off.sum())) / float(want.abs().sum()),
        "element": float(off.abs().max()) / float(want.abs().max()),
    }
    limits = {"relative L2": 1.0, "1 - cosine": 0.1, "bias": 1.0, "element": 1.0}
    worst = {name: value for name, value in found.items() if value > limits[name] * tolerance}
    assert not worst, f"{what}: {worst}"


def render_raster(gaussians: Gaussians, camera: Camera, *outputs: str, **settings: object):
    """The back end under test."""
    return render(
        gaussians, camera, outputs=outputs, settings=RenderSettings(**settings), backend="raster"
    )


def stack(count: int, opacity: float, place: tuple[float, float] = (0.0, 0.0)) -> Gaussians:
    """Coincident small Gaussians two units ahead, ``place`` in units of the focal length."""
    one = random_gaussians(1, dtype=torch.float32, bands=1)
    one = replace(
        one,
        means=torch.tensor([[2 * place[0], 2 * place[1], 2.0]]),
        scales=torch.full((1, 3), 0.02),
        opacities=torch.tensor([opacity]),
    )
    return one.select(torch.zeros(count, dtype=torch.long))


def cloud(count: int, seed: int = 0, bands: int = 1, spread_px: float = 3.0) -> Gaussians:
    """Float32 Gaussians in front of ``wide_camera``, about ``spread_px`` pixels wide."""
    gaussians = random_gaussians(count, seed, bands, torch.float32)
    generator = torch.Generator().manual_seed(seed + 1)
    sizes = 0.3 + torch.rand(count, 3, generator=generator)
    return replace(gaussians, scales=sizes * spread_px * gaussians.means[:, 2:] / 60.0)


def wide_camera(size_px: tuple[int, int] = (67, 91), dtype: torch.dtype = torch.float32) -> Camera:
    """An image of several tiles of any size, with the principal point off its middle."""
    camera = pinhole(60.0, size_px, dtype)
    shift = camera.center_px.new_tensor([4.3, -2.6])
    return replace(
        camera,
        focal_px=camera.focal_px * camera.focal_px.new_tensor([1.0, 1.1]),
        center_px=camera.center_px + shift,
    )


def as_arrays(gaussians: Gaussians) -> list[np.ndarray]:
    """Means, quats, scales, opacities and harmonics."""
    return [getattr(gaussians, name).detach().contiguous().numpy() for name in PARAMETERS]


def meets_rectangle(
    shape: np.ndarray, box: tuple[float, float, float, float], cutoff: float
) -> bool:
    """Whether the ellipse where the opacity is ``cutoff`` meets (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = box[0] - shape[0], box[1] - shape[1], box[2] - shape[0], box[3] - shape[1]
    a, k, b, level = shape[2:]
    room = level - math.log2(cutoff)

    def least(dx: np.ndarray, dy: np.ndarray) -> float:
        return float(np.min((a * dx) ** 2 + (b * dy - k * dx) ** 2))

    if x0 <= 0 <= x1 and y0 <= 0 <= y1:
        return room >= 0
    # Along an edge the exponent is a parabola: its vertex, held to the edge.
    along_x, along_y = b * k / (a * a + k * k), k / b
    sides = np.array([x0, x1, x0, x1]), np.array([y0, y0, y1, y1])
    on_x = np.array([x0, x1]), np.clip(along_y * np.array([x0, x1]), y0, y1)
    on_y = np.clip(along_x * np.array([y0, y1]), x0, x1), np.array([y0, y1])
    return min(least(*sides), least(*on_x), least(*on_y)) <= room
