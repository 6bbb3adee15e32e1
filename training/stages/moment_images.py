"""Images of a scene at one time, at once or one by one with deferred back-propagation."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial

import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.plane_prior import UNSEEN
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.training.stages.deferred import Images, deferred

SETTINGS = RenderSettings(alpha_cutoff=UNSEEN / 10)
NAMES = tuple(field.name for field in fields(Gaussians))


def unchanged(gaussians: Gaussians) -> Gaussians:
    """A scene in which nothing moves."""
    return gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """Gaussians at one time, made when they are drawn."""

    gaussians: Gaussians
    """Canonical."""
    inputs: tuple[Tensor, ...] = ()
    """What decides their motion."""
    change: Callable[..., Gaussians] = unchanged
    """From the Gaussians and ``inputs`` to the Gaussians at that time."""


def images_of(moment: Moment, cameras: Camera, defer: bool) -> Images:
    """Colour (p, h, w, 3) and depth (p, h, w) from cameras of batch shape (p,)."""
    if not defer:
        return _drawn(moment.change(moment.gaussians, *moment.inputs), cameras)
    tensors = [getattr(moment.gaussians, name) for name in NAMES]
    views = range(cameras.world_from_camera.shape[0])
    found = [
        deferred(partial(_redrawn, moment.change, cameras[view]), *tensors, *moment.inputs)
        for view in views
    ]
    rgb, depth = zip(*found, strict=True)
    return torch.stack(rgb), torch.stack(depth)


def _redrawn(change: Callable[..., Gaussians], camera: Camera, *tensors: Tensor) -> Images:
    given, inputs = tensors[: len(NAMES)], tensors[len(NAMES) :]
    gaussians = Gaussians(**dict(zip(NAMES, given, strict=True)))
    return _drawn(change(gaussians, *inputs), camera)


def _drawn(gaussians: Gaussians, cameras: Camera) -> Images:
    output = render(gaussians, cameras, outputs=("rgb", "depth"), settings=SETTINGS)
    return output.rgb, output.depth
