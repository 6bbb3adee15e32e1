"""Images of a scene at another resolution than its own: footprints follow the camera.

A scene's Gaussians are as dense and as wide as the pixels of the cameras on its own path. With s
pixels of another camera for one of those,

    s > 1    the dilation becomes s² d + (s² − 1) c: the scene keeps its look, and what lies between
             its samples is closed (c = 0.02 of its pixels squared, for scenes without dilation)
    s < 1    ⌈1 / s⌉² pixels are rendered for one and averaged, so that no sample falls between
             pixels; depth and flow are averaged by what each pixel covers

At s = 1, which any camera of the path's image size has, nothing is changed, to the bit. Bare
Gaussians and renders with a given dilation follow their settings alone.
"""

import math
from collections.abc import Collection
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.settings import RenderOutput, RenderSettings
from diff4splat.scene.scene import Scene

CLOSING_PX2 = 0.02
"""Closes the gaps between Gaussians half a pixel apart and a quarter wide; more only blurs
(docs/reference/rendering.md)."""
ROUNDING = 1e-3
MAX_ENLARGED = 2
"""Largest side of what is rendered for averaging, over that of the scene's own images."""


def sampling_ratio(scene: Scene, camera: Camera) -> float:
    """Pixels of ``camera`` for one of the scene's own images, side by side; the densest one."""
    own = scene.path.cameras
    if camera.size_px == own.size_px or len(scene.path) == 0:
        return 1.0
    ratio = float(camera.focal_px.detach().max()) / float(own.focal_px[0].detach().max())
    return ratio if math.isfinite(ratio) and ratio > 0 else 1.0


def scene_dilation_px2(scene: Scene, camera: Camera) -> float:
    """The dilation that the scene asks for in an image of ``camera``."""
    growth = max(sampling_ratio(scene, camera), 1.0) ** 2
    if growth < 1 + ROUNDING:
        return scene.dilation_px2
    closing = CLOSING_PX2 if scene.dilation_px2 < CLOSING_PX2 else 0.0
    return scene.dilation_px2 * growth + closing * (growth - 1)


def averaging_factor(scene: Scene, camera: Camera) -> int:
    """Pixels per side that are rendered for one pixel of ``camera``."""
    wanted = math.ceil(1 / sampling_ratio(scene, camera) - ROUNDING)
    most = math.ceil(MAX_ENLARGED * max(scene.path.cameras.size_px) / max(camera.size_px))
    return max(min(wanted, most), 1)


def enlarged(camera: Camera, factor: int) -> Camera:
    """The same view with ``factor`` times as many pixels per side."""
    height, width = camera.size_px
    return camera.resized((factor * height, factor * width))


def enlarged_path(path: CameraPath, factor: int) -> CameraPath:
    """The same path with ``factor`` times as many pixels per side."""
    return replace(path, cameras=enlarged(path.cameras, factor))


def enlarged_settings(settings: RenderSettings, factor: int) -> RenderSettings:
    """The same settings, with flow to an enlarged camera."""
    if settings.flow_camera is None:
        return settings
    return replace(settings, flow_camera=enlarged(settings.flow_camera, factor))


def averaged(output: RenderOutput, factor: int, wanted: Collection[str]) -> RenderOutput:
    """Each ``factor``² pixels of an enlarged image as one; ``output`` has alpha."""
    weight = output.alpha
    covered = _mean(weight, factor)
    images: dict[str, Tensor | None] = {"alpha": covered if "alpha" in wanted else None}
    for name, channels in (("rgb", 1), ("features", 1)):
        image = getattr(output, name)
        images[name] = None if image is None else _mean(image, factor, channels)
    safe = torch.where(covered > 0, covered, 1.0)
    if output.depth is not None:
        images["depth"] = _mean(output.depth * weight, factor) / safe
    if output.flow is not None:
        flow = _mean(output.flow * weight[..., None], factor, 1) / safe[..., None]
        images["flow"] = flow / factor
    if output.median_depth is not None:
        images["median_depth"] = _blocks(output.median_depth, factor).median(-1).values
    return replace(output, **images)


def _mean(image: Tensor, factor: int, channels: int = 0) -> Tensor:
    if channels:
        return _mean(image.movedim(-1, 0), factor).movedim(0, -1)
    return _blocks(image, factor).mean(-1)


def _blocks(image: Float[Tensor, "*b hh ww"], factor: int) -> Float[Tensor, "*b h w s"]:
    """The pixels that become one, side by side."""
    height, width = (side // factor for side in image.shape[-2:])
    split = image.unflatten(-1, (width, factor)).unflatten(-3, (height, factor))
    return split.transpose(-3, -2).flatten(-2)
