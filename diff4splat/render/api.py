"""Pictures of a scene: any camera, any time, any back end.

Axes: ``h w`` pixels, ``t`` frames. Times are seconds.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import fields, replace

import torch

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.backends import choose
from diff4splat.render.settings import RenderJob, RenderOutput, RenderSettings, require_outputs
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

DEFAULTS = RenderSettings()


def _nothing() -> None:
    """Progress that nobody watches."""


def render(
    scene_or_gaussians: Scene | Gaussians,
    camera: Camera,
    time_s: float = 0.0,
    *,
    outputs: Collection[str] = ("rgb",),
    settings: RenderSettings = DEFAULTS,
    backend: str = "auto",
) -> RenderOutput:
    """Pictures named in ``outputs``, one camera at one time; the others are not computed.

    The camera takes the dtype and device of the Gaussians.

    Raises:
        ConfigError: an unknown output or back end, or a flow without a place or time to flow to.
        ShapeError: a batch of cameras, half precision, or mixed dtypes or devices.
        InputError: a camera with NaN, infinity or a focal length of 0 or less.
    """
    wanted = require_outputs(outputs)
    if "flow" in wanted and settings.flow_camera is None and settings.flow_time_s is None:
        raise ConfigError(
            "outputs: flow expected settings.flow_time_s or settings.flow_camera, got neither"
        )
    later_s = time_s if settings.flow_time_s is None else settings.flow_time_s
    gaussians = _uniform(_state(scene_or_gaussians, time_s))
    later = gaussians
    if "flow" in wanted and later_s != time_s:
        later = _uniform(_state(scene_or_gaussians, later_s))
    job = RenderJob(
        gaussians=gaussians,
        camera=_usable(camera, gaussians),
        outputs=wanted,
        settings=settings,
        flow_gaussians=later,
        flow_camera=_usable(
            camera if settings.flow_camera is None else settings.flow_camera, gaussians
        ),
    )
    return choose(backend, job).render(job)


def render_video(
    scene: Scene,
    path: CameraPath,
    *,
    outputs: Collection[str] = ("rgb",),
    settings: RenderSettings = DEFAULTS,
    backend: str = "auto",
    advance: Callable[[], None] = _nothing,
) -> Iterator[RenderOutput]:
    """One ``RenderOutput`` per pose of ``path``, made when it is asked for; memory holds one frame.

    ``advance`` is called after each frame. Unless the settings say where to, flow runs to the next
    frame; the last one has none to run to, so its flow is 0.

    Raises:
        ConfigError: an unknown output.
    """
    wanted = require_outputs(outputs)
    # A scene that stands still needs no state per frame.
    subject = scene.gaussians if isinstance(scene.motion, StaticMotion) else scene
    times_s, last = path.times_s.tolist(), len(path) - 1
    to_next = settings.flow_camera is None and settings.flow_time_s is None

    def frame(index: int) -> RenderOutput:
        following = min(index + 1, last)
        own = settings
        if to_next:
            own = replace(
                settings, flow_camera=path.cameras[following], flow_time_s=times_s[following]
            )
        picture = render(
            subject,
            path.cameras[index],
            times_s[index],
            outputs=wanted,
            settings=own,
            backend=backend,
        )
        advance()
        return picture

    return map(frame, range(len(path)))


def _state(scene_or_gaussians: Scene | Gaussians, time_s: float) -> Gaussians:
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


def _usable(camera: Camera, gaussians: Gaussians) -> Camera:
    """One finite camera in the arithmetic of ``gaussians``."""
    if camera.batch_shape != ():
        raise ShapeError(
            f"camera: expected one camera, got a batch of shape {camera.batch_shape}; "
            "index it, or use render_video"
        )
    numbers = [camera.world_from_camera.flatten(), camera.focal_px, camera.center_px]
    if not bool(torch.isfinite(torch.cat(numbers)).all() and (camera.focal_px > 0).all()):
        raise InputError("camera: expected finite pose and intrinsics and focal lengths above 0")
    return camera.to(gaussians.means.dtype).to(gaussians.means.device)
