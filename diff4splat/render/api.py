"""Images of a scene: any camera, any time, any back end.

Axes: ``h w`` pixels, ``t`` frames. Times are seconds.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.backends import choose
from diff4splat.render.jobs import checked_camera, make_job, one_by_one, state_of
from diff4splat.render.resolution import (
    averaged,
    averaging_factor,
    enlarged,
    enlarged_path,
    enlarged_settings,
    scene_dilation_px2,
)
from diff4splat.render.settings import (
    RenderJob,
    RenderOutput,
    RenderSettings,
    require_outputs,
    stack_outputs,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

DEFAULTS = RenderSettings()
UNDILATED = RenderSettings(dilation_px2=0.0)
"""As scenes made from images are rendered (ADR 24)."""


def _nothing() -> None:
    """Progress that nobody watches."""


def render(
    scene_or_gaussians: Scene | Gaussians,
    camera: Camera,
    time_s: float | Float[Tensor, " b"] = 0.0,
    *,
    outputs: Collection[str] = ("rgb",),
    settings: RenderSettings = DEFAULTS,
    backend: str = "auto",
) -> RenderOutput:
    """Images named in ``outputs``; the others are not computed.

    One camera gives one image of each. A batch of cameras, at one time or one each, gives
    images with a leading axis. Times move scenes, not bare Gaussians, and have no gradient.
    Cameras take the dtype and device of the Gaussians.

    Raises:
        ConfigError: an unknown output or back end, a flow without a place or time to flow to, or
            features without values.
        ShapeError: cameras with more than one batch axis, another number of times or features,
            half precision, or mixed dtypes or devices.
        InputError: a camera with NaN, infinity or a focal length of 0 or less, or such features.
    """
    wanted = _require_sources(require_outputs(outputs), settings)
    if settings.dilation_px2 is None and isinstance(scene_or_gaussians, Scene):
        return _render_scene(scene_or_gaussians, camera, time_s, wanted, settings, backend)
    if camera.batch_shape == () and not isinstance(time_s, Tensor):
        job = make_job(scene_or_gaussians, camera, time_s, wanted, settings)
        return choose(backend, job).render(job)
    cameras, times_s = one_by_one(camera, time_s)
    if len(set(times_s)) == 1 and "flow" not in wanted:
        # One state serves all cameras.
        scene_or_gaussians = state_of(scene_or_gaussians, times_s[0])
    frames = [
        render(scene_or_gaussians, one, at, outputs=wanted, settings=settings, backend=backend)
        for one, at in zip(cameras, times_s, strict=True)
    ]
    return stack_outputs(frames)


def _render_scene(
    scene: Scene,
    camera: Camera,
    time_s: float | Float[Tensor, " b"],
    wanted: frozenset[str],
    settings: RenderSettings,
    backend: str,
) -> RenderOutput:
    """As the scene asks for in an image of this resolution."""
    factor, outputs = averaging_factor(scene, camera), wanted
    if factor > 1:
        camera, settings = enlarged(camera, factor), enlarged_settings(settings, factor)
        outputs = wanted | {"alpha"}
    settings = with_default_dilation(scene, camera, settings)
    image = render(scene, camera, time_s, outputs=outputs, settings=settings, backend=backend)
    return image if factor == 1 else averaged(image, factor, wanted)


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

    ``advance`` is called when a frame is done. Unless the settings say where to, flow runs to the
    next frame; the last one has none to run to, so its flow is 0.

    Raises:
        ConfigError: an unknown output.
    """
    wanted = require_outputs(outputs)
    if "flow" not in wanted:
        _require_sources(wanted, settings)
    factor = averaging_factor(scene, path.cameras) if settings.dilation_px2 is None else 1
    if factor > 1:
        path, settings = enlarged_path(path, factor), enlarged_settings(settings, factor)
    settings = with_default_dilation(scene, path.cameras, settings)
    if factor == 1:
        return _frames(scene, path, wanted, settings, backend, advance)
    frames = _frames(scene, path, wanted | {"alpha"}, settings, backend, advance)
    return (averaged(frame, factor, wanted) for frame in frames)


def _frames(
    scene: Scene,
    path: CameraPath,
    outputs: frozenset[str],
    settings: RenderSettings,
    backend: str,
    advance: Callable[[], None],
) -> Iterator[RenderOutput]:
    times_s, last = path.times_s.tolist(), len(path) - 1
    to_next = "flow" in outputs and settings.flow_camera is None and settings.flow_time_s is None
    # A static scene needs no state per frame.
    subject = scene.gaussians if isinstance(scene.motion, StaticMotion) else scene
    shared = None
    if last > 0 and "flow" not in outputs:
        first = make_job(subject, path.cameras[0], times_s[0], outputs, settings)
        shared = _shared(scene, first, backend)
    for index in range(last + 1):
        camera, own = path.cameras[index], settings
        if to_next:
            following = min(index + 1, last)
            own = replace(
                settings, flow_camera=path.cameras[following], flow_time_s=times_s[following]
            )
        if shared is not None:
            image = shared(camera, times_s[index])
        else:
            image = render(
                subject, camera, times_s[index], outputs=outputs, settings=own, backend=backend
            )
        advance()
        yield image


def with_default_dilation(scene: Scene, camera: Camera, settings: RenderSettings) -> RenderSettings:
    """The settings with what the scene itself asks for, where they leave it open."""
    if settings.dilation_px2 is not None:
        return settings
    return replace(settings, dilation_px2=scene_dilation_px2(scene, camera))


def _require_sources(outputs: frozenset[str], settings: RenderSettings) -> frozenset[str]:
    """``outputs`` when the settings hold what they are made of."""
    if "flow" in outputs and settings.flow_camera is None and settings.flow_time_s is None:
        raise ConfigError(
            "outputs: flow expected settings.flow_time_s or settings.flow_camera, got neither"
        )
    if "features" in outputs and settings.features is None:
        raise ConfigError("outputs: features expected settings.features, got None")
    return outputs


def _shared(
    scene: Scene, first: RenderJob, backend: str
) -> Callable[[Camera, float], RenderOutput] | None:
    """What draws frames with shared work, if the back end of the first one has it."""
    opener = getattr(choose(backend, first), "open_sequence", None)
    draw = opener(scene, first) if opener else None
    if draw is None:
        return None
    return lambda camera, time_s: draw(checked_camera(camera, first.gaussians), time_s)
