"""From what callers pass to what a back end draws: one image, one arithmetic, one finite camera."""

from dataclasses import fields, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.render.settings import RenderJob, RenderSettings
from diff4splat.render.support import renderable_gaussians, require_finite_camera
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene


def make_job(
    subject: Scene | Gaussians,
    camera: Camera,
    time_s: float,
    outputs: frozenset[str],
    settings: RenderSettings,
) -> RenderJob:
    """One image, with both ends of the flow."""
    later_s = time_s if settings.flow_time_s is None else settings.flow_time_s
    gaussians = _uniform(state_of(subject, time_s))
    later = gaussians
    if "flow" in outputs and later_s != time_s:
        later = _uniform(state_of(subject, later_s))
    later_camera = camera if settings.flow_camera is None else settings.flow_camera
    return RenderJob(
        gaussians=gaussians,
        camera=checked_camera(camera, gaussians),
        outputs=outputs,
        settings=_matching(settings, gaussians),
        flow_gaussians=later,
        flow_camera=checked_camera(later_camera, gaussians),
    )


def one_by_one(
    camera: Camera, time_s: float | Float[Tensor, " b"]
) -> tuple[list[Camera], list[float]]:
    """Cameras and times one by one; one of either serves all of the other."""
    if len(camera.batch_shape) > 1:
        raise ShapeError(
            f"camera: expected at most one batch axis, got shape {camera.batch_shape}; flatten it"
        )
    times_s = time_s.tolist() if isinstance(time_s, Tensor) else [float(time_s)]
    times_s = times_s if isinstance(times_s, list) else [times_s]
    cameras = [camera] if camera.batch_shape == () else [camera[i] for i in range(len(camera))]
    if not cameras or not times_s:
        raise ShapeError("camera and time_s: expected at least one of each, got an empty batch")
    count = len(times_s) if len(cameras) == 1 else len(cameras)
    if len(times_s) not in (1, count):
        raise ShapeError(f"time_s: expected 1 or {count} times for the cameras, got {len(times_s)}")
    return cameras * (count // len(cameras)), times_s * (count // len(times_s))


def _matching(settings: RenderSettings, gaussians: Gaussians) -> RenderSettings:
    """Settings whose features belong to ``gaussians``, in their dtype and on their device."""
    features = settings.features
    if features is None:
        return settings
    if features.ndim != 2 or len(features) != len(gaussians):
        raise ShapeError(
            f"settings.features: expected ({len(gaussians)}, channels), got {tuple(features.shape)}"
        )
    finite = torch.isfinite(features)
    if not bool(finite.all()):
        # Gaussians that are left out anyway may have any features.
        usable, _ = renderable_gaussians(gaussians)
        if not bool(finite[usable].all()):
            raise InputError("settings.features: expected finite numbers, got NaN or infinity")
        features = torch.where(finite, features, 0.0)
    return replace(settings, features=features.to(gaussians.means))


def state_of(scene_or_gaussians: Scene | Gaussians, time_s: float) -> Gaussians:
    """A scene's Gaussians at that time; bare ones do not move."""
    if isinstance(scene_or_gaussians, Scene):
        return scene_or_gaussians.state_at(time_s)
    return scene_or_gaussians


def _uniform(gaussians: Gaussians) -> Gaussians:
    """``gaussians`` when one arithmetic fits all of it."""
    tensors = [getattr(gaussians, field.name) for field in fields(gaussians)]
    kinds = {(tensor.dtype, tensor.device) for tensor in tensors}
    if len(kinds) != 1:
        got = ", ".join(sorted(f"{dtype} on {device}" for dtype, device in kinds))
        raise ShapeError(f"Gaussians: expected one dtype and device, got {got}; call .to()")
    if tensors[0].dtype not in (torch.float32, torch.float64):
        raise ShapeError(
            f"Gaussians: expected float32 or float64, got {tensors[0].dtype}; "
            "call .to(torch.float32)"
        )
    return gaussians


def checked_camera(camera: Camera, gaussians: Gaussians) -> Camera:
    """One finite camera in the arithmetic of ``gaussians``."""
    if camera.batch_shape != ():
        raise ShapeError(
            f"settings.flow_camera: expected one camera, got a batch of shape {camera.batch_shape}"
        )
    require_finite_camera(camera)
    return camera.to(gaussians.means.dtype).to(gaussians.means.device)
