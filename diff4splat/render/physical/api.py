"""Images of a scene through a physical camera: lens, aperture, shutter and exposure at once.

camera, scene ─ effects that show ─ none: rasteriser
                                  └ some: intervals of time ─ sensor rays ─ tracer ─ mean per pixel
"""

import math
from collections.abc import Collection
from dataclasses import replace

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.effects import find_effects
from diff4splat.render.physical.exposure import Exposure
from diff4splat.render.physical.pinhole import rasterize_pinhole
from diff4splat.render.physical.settings import OUTPUTS, Photograph, PhotoSettings
from diff4splat.render.resolution import scene_dilation_px2
from diff4splat.render.settings import require_outputs
from diff4splat.render.support import require_finite_camera
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import DILATION_PX2, Scene

DEFAULTS = PhotoSettings()


def photograph(
    scene_or_gaussians: Scene | Gaussians,
    camera: PhysicalCamera,
    time_s: float = 0.0,
    *,
    outputs: Collection[str] = ("rgb",),
    settings: PhotoSettings = DEFAULTS,
    backend: str = "auto",
) -> Photograph:
    """One image; gradients reach scene, pose, intrinsics, lens, aperture, shutter and exposure.

    ``backend`` "trace" always traces rays; "auto", or the name of a rasteriser, rasterises if the
    camera has no visible effect.

    Raises:
        ConfigError: an unknown output or back end, or a rasteriser for a camera with effects.
        InputError: a camera or time that is not finite, or more rays with gradients than fit
            in memory.
    """
    wanted = require_outputs(outputs, OUTPUTS)
    subject = scene_or_gaussians
    means = (subject if isinstance(subject, Gaussians) else subject.gaussians).means
    camera = _valid_camera(camera, time_s).to(means.dtype).to(means.device)
    settings = with_default_smoothing(subject, camera.camera, settings)
    effects = find_effects(subject, camera, time_s, settings)
    if backend == "trace" or effects.any:
        if backend not in ("trace", "auto"):
            raise ConfigError(
                f"backend: expected 'trace' or 'auto' for a camera with effects, got {backend!r}"
            )
        exposure = Exposure(
            subject=subject, camera=camera, time_s=time_s, settings=settings, effects=effects
        )
        return exposure.take(wanted)
    return rasterize_pinhole(subject, camera, time_s, wanted, settings, effects, backend)


def with_default_smoothing(
    subject: Scene | Gaussians, camera: Camera, settings: PhotoSettings
) -> PhotoSettings:
    """The settings with the smoothing that ``subject`` was trained with, unless they set one."""
    if settings.smoothing_px2 is not None:
        return settings
    scene = isinstance(subject, Scene)
    asked = scene_dilation_px2(subject, camera) if scene else DILATION_PX2
    return replace(settings, smoothing_px2=asked)


def _valid_camera(camera: PhysicalCamera, time_s: float) -> PhysicalCamera:
    """``camera`` if it is valid.

    Raises:
        InputError: a number is not finite, or a focal length is 0 or less.
    """
    require_finite_camera(camera.camera)
    if not math.isfinite(time_s):
        raise InputError(f"time_s: expected a finite number, got {time_s}")
    return camera
