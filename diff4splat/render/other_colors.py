"""One view of Gaussians in other colours, again and again (ours).

Axes: ``n`` Gaussians, ``k`` harmonics, ``h w`` pixels.
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.render.api import DEFAULTS
from diff4splat.render.backends import choose
from diff4splat.render.jobs import make_job
from diff4splat.render.settings import RenderJob, RenderSettings
from diff4splat.scene.gaussians import Gaussians

Draw = Callable[[Float[Tensor, "n k 3"]], Float[Tensor, "h w 3"]]
"""From harmonics to the image."""


def open_view(
    gaussians: Gaussians,
    camera: Camera,
    *,
    settings: RenderSettings = DEFAULTS,
    backend: str = "auto",
) -> Draw:
    """What draws ``gaussians`` from ``camera`` with the harmonics that it gets, without gradients.

    Images are those of ``render``. Where the back end shares work between them, all but the first
    take a fraction of its time.

    Raises:
        ConfigError, ShapeError, InputError: as ``render``; ShapeError also if harmonics have
            another shape than those of ``gaussians``.
    """
    job = make_job(gaussians, camera, 0.0, frozenset({"rgb"}), settings)
    chosen = choose(backend, job)
    opener = getattr(chosen, "open_view", None)
    # Gaussians without finite colours are left out, which no shared work knows of.
    shared = opener(job) if opener and _is_finite(gaussians.sh) else None

    @torch.no_grad()
    def draw(sh: Float[Tensor, "n k 3"]) -> Float[Tensor, "h w 3"]:
        if sh.shape != gaussians.sh.shape:
            raise ShapeError(
                f"sh: expected {tuple(gaussians.sh.shape)} as at first, got {tuple(sh.shape)}"
            )
        if shared is not None and _is_finite(sh):
            return shared(sh).rgb
        return chosen.render(_in_colors(job, sh)).rgb

    return draw


def _is_finite(sh: Float[Tensor, "n k 3"]) -> bool:
    return bool(torch.isfinite(sh).all())


def _in_colors(job: RenderJob, sh: Float[Tensor, "n k 3"]) -> RenderJob:
    gaussians = replace(job.gaussians, sh=sh)
    return replace(job, gaussians=gaussians, flow_gaussians=gaussians)
