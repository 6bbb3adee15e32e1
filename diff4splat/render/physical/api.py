"""Pictures of a scene through a physical camera: lens, aperture, shutter and exposure at once.

camera, scene ─ effects that show ─ none: rasteriser
                                  └ some: intervals of time ─ sensor rays ─ tracer ─ mean per pixel
"""

import math
from collections.abc import Collection
from dataclasses import replace

import torch

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.effects import find_effects
from diff4splat.render.physical.exposure import Exposure
from diff4splat.render.physical.pinhole import rasterize_pinhole
from diff4splat.render.physical.settings import OUTPUTS, Photograph, PhotoSettings
from diff4splat.render.settings import require_outputs
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
    """One picture; gradients reach scene, pose, intrinsics, lens, aperture, shutter and exposure.

    ``backend`` "trace" follows rays in any case; "auto", or the name of a rasteriser, draws as a
    pinhole does where no effect shows.

    Raises:
        ConfigError: an unknown output or back end, or a rasteriser for a camera with effects.
        InputError: a camera or time that is not finite, or more rays with gradients than memory
            holds.
    """
    wanted = require_outputs(outputs, OUTPUTS)
    own = scene_or_gaussians
    means = (own if isinstance(own, Gaussians) else own.gaussians).means
    camera = _usable(camera, time_s).to(means.dtype).to(means.device)
    settings = with_default_smoothing(own, settings)
    effects = find_effects(own, camera, time_s, settings)
    if backend == "trace" or effects.any:
        if backend not in ("trace", "auto"):
            raise ConfigError(
                f"backend: expected 'trace' or 'auto' for a camera with effects, got {backend!r}"
            )
        exposure = Exposure(
            subject=own, camera=camera, time_s=time_s, settings=settings, effects=effects
        )
        return exposure.take(wanted)
    return rasterize_pinhole(own, camera, time_s, wanted, settings, effects, backend)


def with_default_smoothing(subject: Scene | Gaussians, settings: PhotoSettings) -> PhotoSettings:
    """The settings with what the subject itself asks for, where they leave it open."""
    if settings.smoothing_px2 is not None:
        return settings
    asked = subject.dilation_px2 if isinstance(subject, Scene) else DILATION_PX2
    return replace(settings, smoothing_px2=asked)


def _usable(camera: PhysicalCamera, time_s: float) -> PhysicalCamera:
    """``camera`` when rays can start from it.

    Raises:
        InputError: a number is not finite, or a focal length is 0 or less.
    """
    own = camera.camera
    numbers = torch.cat([own.world_from_camera.flatten(), own.focal_px, own.center_px]).detach()
    if not bool(torch.isfinite(numbers).all() and (own.focal_px > 0).all()):
        raise InputError("camera: expected finite pose and intrinsics and focal lengths above 0")
    if not math.isfinite(time_s):
        raise InputError(f"time_s: expected a finite number, got {time_s}")
    return camera
