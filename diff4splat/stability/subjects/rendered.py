"""A render of Gaussians by the fast back ends in float32, against the references in float64.

Every image of the rasteriser and of the ray tracer is compared, and differentiated with respect to
all parameters of the Gaussians.
"""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import world_rays
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians
from diff4splat.stability.check import Outcome
from diff4splat.stability.compare import all_finite, finite_gradients, psnr_db, rms_error
from diff4splat.stability.plots import Thumbnail

RENDER_LIMIT, TRACE_LIMIT = 1e-3, 1e-3
"""RMS of RGB, 60 dB. Rounding moves contributions over the cut-off of 1/255, so single pixels may
differ by more."""
OUTPUTS = ("rgb", "depth", "alpha")


@dataclass(frozen=True, slots=True, kw_only=True)
class Images:
    """What one back end makes of a scene, and whether its gradients are finite."""

    rgb: Float[Tensor, "h w 3"]
    others: tuple[Tensor, ...]
    gradient_finite: bool | None


def measure_render(
    gaussians: Gaussians, camera: Camera, settings: RenderSettings | None = None
) -> Outcome:
    """The rasteriser."""
    settings = RenderSettings() if settings is None else settings
    exact = _rasterise(gaussians, camera, settings, torch.float64, "reference")
    got = _rasterise(gaussians, camera, settings, torch.float32, "raster")
    return _outcome(got, exact)


def measure_trace(gaussians: Gaussians, camera: Camera) -> Outcome:
    """The ray tracer."""
    exact = _trace(gaussians, camera, torch.float64, "reference")
    got = _trace(gaussians, camera, torch.float32, "compiled")
    return _outcome(got, exact)


def _outcome(got: Images, exact: Images) -> Outcome:
    error = rms_error(got.rgb, exact.rgb)
    return Outcome(
        error=error,
        value_finite=all_finite([got.rgb, *got.others]),
        gradient_finite=got.gradient_finite,
        note=psnr_db(error) if exact.rgb.any() else "nothing is visible, in float64 either",
        plots=(Thumbnail(caption="", rgb=got.rgb.detach()),),
    )


def _rasterise(
    gaussians: Gaussians,
    camera: Camera,
    settings: RenderSettings,
    dtype: torch.dtype,
    backend: str,
) -> Images:
    leaves = _leaves(gaussians, dtype)
    image = render(
        replace(gaussians, **leaves), camera, outputs=OUTPUTS, settings=settings, backend=backend
    )
    images = (image.rgb, image.depth, image.alpha)
    return Images(
        rgb=image.rgb, others=images[1:], gradient_finite=finite_gradients(images, leaves)
    )


def _trace(gaussians: Gaussians, camera: Camera, dtype: torch.dtype, backend: str) -> Images:
    leaves = _leaves(gaussians, dtype)
    origins, directions = (part.flatten(0, 1) for part in world_rays(camera.to(dtype)))
    rays = Rays(origins=origins, directions=directions)
    got = trace(
        replace(gaussians, **leaves), rays, outputs=("rgb", "distance", "alpha"), backend=backend
    )
    images = (got.rgb, got.distance, got.alpha)
    return Images(
        rgb=got.rgb.unflatten(0, camera.size_px),
        others=images[1:],
        gradient_finite=finite_gradients(images, leaves),
    )


def _leaves(gaussians: Gaussians, dtype: torch.dtype) -> dict[str, Tensor]:
    """Copies that ask for gradients."""
    values = {field.name: getattr(gaussians, field.name) for field in fields(gaussians)}
    return {name: value.detach().to(dtype).requires_grad_() for name, value in values.items()}
