"""Scenes on which gsplat is compared with the reference, and how far the two may be apart.

Pixels are compared in decibels of the largest value. A pixel whose light falls to 1e-4 is one that
gsplat leaves early: what it misses is at most the light that it leaves over.
"""

import math
from dataclasses import fields, replace

import torch
from oracles_render import random_gaussians, small_camera
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.depth import unproject
from diff4splat.render.api import render
from diff4splat.render.settings import RenderOutput, RenderSettings
from diff4splat.scene.gaussians import Gaussians

MADE = ("rgb", "depth", "alpha", "flow", "features")
LEAST_DECIBELS = 60.0
LEAST_ALPHA = 0.05
"""Averages over less weight than this hang on single contributions at the cutoff."""
LIGHT_CUTOFF = 1e-4

View = tuple[Gaussians, Camera]


def random_view(edge_px: int = 48, count: int = 300) -> View:
    """Splats of any shape before a camera that is moved and turned; all harmonics."""
    gaussians = random_gaussians(count, bands=16, dtype=torch.float32)
    camera = small_camera((13, 17), torch.float32).resized((edge_px, edge_px + edge_px // 3))
    return replace(gaussians, scales=gaussians.scales * (300 / count) ** 0.5), camera


def aligned_view(edge_px: int = 40, opacity: float = 0.95) -> View:
    """One Gaussian per pixel on a smooth depth map, seen from where it was made."""
    generator, camera = (
        torch.Generator().manual_seed(0),
        pinhole(float(edge_px), (edge_px, edge_px)),
    )
    knots = 4 + torch.rand(1, 1, 8, 8, generator=generator)
    depth = torch.nn.functional.interpolate(knots, camera.size_px, mode="bicubic")[0, 0]
    count = depth.numel()
    gaussians = Gaussians(
        means=unproject(camera, depth).flatten(0, 1),
        quats=torch.eye(4)[0].repeat(count, 1),
        # Round splats would have no gradient for their rotation.
        scales=(depth / camera.focal_px[0]).flatten()[:, None] * torch.tensor([0.5, 0.4, 0.6]),
        opacities=torch.full((count,), opacity),
        sh=torch.rand(count, 1, 3, generator=generator),
    )
    return gaussians, camera


def extreme_view(**changes: object) -> View:
    """A few Gaussians with some parameters replaced by one value."""
    gaussians = random_gaussians(20, dtype=torch.float32)
    values = {
        name: torch.as_tensor(value, dtype=torch.float32).expand(getattr(gaussians, name).shape)
        for name, value in changes.items()
    }
    return replace(gaussians, **values), pinhole(16.0, (12, 14))


FLAT = [1.0, 0.0, 0.0, 0.0]
EXTREMES: dict[str, View] = {
    "tiny": extreme_view(scales=1e-6),
    "vanishing": extreme_view(scales=0.0),
    "huge": extreme_view(scales=1e3),
    "needles": extreme_view(scales=[1.0, 1e-3, 1e-3]),
    "discs": extreme_view(scales=[1.0, 1.0, 0.0]),
    "clear": extreme_view(opacities=0.0),
    "opaque": extreme_view(opacities=1.0),
    "zero quaternions": extreme_view(quats=0.0),
    "tiny quaternions": extreme_view(quats=1e-30),
    "huge quaternions": extreme_view(quats=1e18),
    "coincident": extreme_view(means=[0.1, 0.0, 2.0]),
    "coplanar": extreme_view(scales=[0.1, 0.1, 1e-6], quats=FLAT),
    "edge on": extreme_view(scales=[0.1, 0.1, 0.0], quats=[0.5**0.5, 0.5**0.5, 0.0, 0.0]),
    "on the camera plane": extreme_view(means=[1.0, 0.0, 0.0]),
    "in the camera": extreme_view(means=0.0),
    "just in front": extreme_view(means=[1.0, 0.0, 0.0101], scales=1.0),
    "behind": extreme_view(means=[0.0, 0.0, -2.0]),
    "very far": extreme_view(means=[0.0, 0.0, 1e12], scales=1e11),
    "bright": extreme_view(sh=1e10),
}


def on(device: str, view: View) -> View:
    """The same on another device."""
    return view[0].to(torch.device(device)), view[1].to(torch.device(device))


def everything(view: View) -> RenderSettings:
    """Settings that make every image possible, on a coloured background."""
    gaussians, camera = view
    pose = camera.world_from_camera.clone()
    pose[:3, 3] += pose.new_tensor([0.1, -0.05, 0.2])
    features = torch.stack([gaussians.opacities, gaussians.means[:, 0], gaussians.means[:, 1]], 1)
    return RenderSettings(
        background=(0.3, 0.6, 0.1), flow_camera=camera.with_pose(pose), features=features
    )


def both(view: View, settings: RenderSettings, outputs=MADE) -> tuple[RenderOutput, RenderOutput]:
    """What gsplat makes of it, and the reference."""
    return tuple(
        render(*view, outputs=outputs, settings=settings, backend=name)
        for name in ("gsplat", "reference")
    )


def decibels(actual: Tensor, wanted: Tensor) -> float:
    """Peak signal to noise; equal images are 300 dB apart from noise."""
    peak = max(1.0, float(wanted.abs().max())) if wanted.numel() else 1.0
    error = float((actual - wanted).double().square().mean()) if wanted.numel() else 0.0
    return 10 * math.log10(peak**2 / max(error, 1e-30 * peak**2))


def left_early(wanted: RenderOutput) -> Tensor:
    """Pixels in which gsplat stops, (h, w)."""
    return wanted.alpha >= 1 - 1.01 * LIGHT_CUTOFF


def strays(got: RenderOutput, want: RenderOutput) -> int:
    """Pixels in which a decision at the cutoff, or in the order, fell differently."""
    return int((((got.alpha - want.alpha).abs() > 1e-3) & ~left_early(want)).sum())


def assert_same_images(
    got: RenderOutput, want: RenderOutput, least: float = LEAST_DECIBELS
) -> None:
    """All pixels of every image; averages where there is enough to average over."""
    assert got.dropped_nonfinite == want.dropped_nonfinite
    assert got.dropped_by_parameter == want.dropped_by_parameter
    solid = torch.minimum(got.alpha, want.alpha) > LEAST_ALPHA
    for name in MADE:
        actual, wanted = getattr(got, name), getattr(want, name)
        assert actual.shape == wanted.shape
        assert bool(torch.isfinite(actual).all()), name
        if name in ("depth", "flow"):
            actual, wanted = actual[solid], wanted[solid]
        assert decibels(actual, wanted) >= least, f"{name}: {decibels(actual, wanted):.1f} dB"


def gradients(
    view: View, backend: str, settings: RenderSettings, outputs: tuple[str, ...] = MADE
) -> dict[str, Tensor]:
    """What a loss of all ``outputs`` says to each parameter of the Gaussians and to the pose."""
    gaussians, camera = view
    leaves = {f.name: getattr(gaussians, f.name).clone() for f in fields(gaussians)}
    pose = leaves["world_from_camera"] = camera.world_from_camera.clone()
    for leaf in leaves.values():
        leaf.requires_grad_()
    watched = replace(gaussians, **{f.name: leaves[f.name] for f in fields(gaussians)})
    camera = camera.with_pose(pose)
    # Alpha says which pixels count.
    asked = {*outputs, "alpha"}
    made = render(watched, camera, outputs=asked, settings=settings, backend=backend)
    loss = _weighed(made, outputs)
    if loss.requires_grad:  # it does not where nothing is seen
        loss.backward()
    return {
        name: torch.zeros_like(leaf) if leaf.grad is None else leaf.grad
        for name, leaf in leaves.items()
    }


def _weighed(made: RenderOutput, outputs: tuple[str, ...]) -> Tensor:
    """A loss that asks something else of every pixel of every image."""
    solid, total = made.alpha.detach() > LEAST_ALPHA, made.alpha.new_zeros(())
    for name in outputs:
        image = getattr(made, name)
        generator = torch.Generator().manual_seed(MADE.index(name))
        weights = torch.randn(image.shape, generator=generator).to(image)
        total = total + (weights * image)[solid].sum() / solid.numel()
    return total


def assert_same_gradients(
    got: dict[str, Tensor], want: dict[str, Tensor], tolerance: float = 1e-2
) -> None:
    """Relative distance at most ``tolerance`` and cosine at least 0.999, for each parameter."""
    for name, gradient in want.items():
        actual, wanted = got[name].double().flatten(), gradient.double().flatten()
        assert bool(torch.isfinite(actual).all()), name
        size = float(wanted.norm())
        assert float((actual - wanted).norm()) <= tolerance * size, name
        if size > 0:
            assert float(actual @ wanted) >= 0.999 * size * float(actual.norm()), name
