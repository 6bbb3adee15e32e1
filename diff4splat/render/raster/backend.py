"""The back end ``raster``: float32 on CPUs, compiled on first use; about fifty times the reference.

Axes: ``n`` Gaussians, ``h w`` pixels, ``c`` channels.
"""

from dataclasses import fields
from importlib.util import find_spec

import torch
from jaxtyping import Float, Int32
from torch import Tensor

from diff4splat.render.channels import extra_channels, name_outputs
from diff4splat.render.projection import camera_space, to_pixels
from diff4splat.render.raster.plan import TILE_SIZES_PX, make_plan
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.scene.gaussians import Gaussians

LARGEST = torch.finfo(torch.float32).max ** 0.5
_MOST_GAUSSIANS = 1 << 24
"""Beyond it float32 cannot number the entries of a list."""


def refusal(job: RenderJob) -> str | None:
    """Why ``job`` cannot be done here, or None."""
    means = job.gaussians.means
    if means.device.type != "cpu":
        return f"expected CPU tensors, got {means.device}"
    if means.dtype != torch.float32:
        return f"expected float32, got {means.dtype}"
    if job.settings.tile_px not in (None, *TILE_SIZES_PX):
        return f"expected tile_px among {TILE_SIZES_PX}, got {job.settings.tile_px}"
    if len(job.gaussians) >= _MOST_GAUSSIANS:
        return f"expected fewer than {_MOST_GAUSSIANS} Gaussians, got {len(job.gaussians)}"
    if find_spec("numba") is None:
        return "expected the package numba, got none; install it"
    return None


def render(job: RenderJob) -> RenderOutput:
    """Make the pictures that ``job`` asks for."""
    # Numba is loaded with the first picture, not with the library.
    from diff4splat.render.raster.function import rasterize
    from diff4splat.render.raster.warm import ensure_compiled

    ensure_compiled()
    medians = "median_depth" in job.outputs
    plan = make_plan(job.camera, job.settings, "rgb" in job.outputs, medians)
    with torch.autocast("cpu", enabled=False):
        depth, center_px = _centers(job)
        extras = extra_channels(
            job, depth, center_px, job.flow_gaussians.means, job.settings.features
        )
        made = rasterize(plan, job.gaussians, extras, job.camera)
        median_depth = _median_depth(depth, made.medians[0]) if medians else None
        counts = zip((f.name for f in fields(Gaussians)), made.unusable, strict=True)
        dropped = {name: count for name, count in counts if count}
        return name_outputs(job, made.planes.permute(1, 2, 0), made.light, median_depth, dropped)


def _centers(job: RenderJob) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 2"]]:
    """Z and pixel of the means; 1 and the origin for those that nothing can see or square."""
    means = job.gaussians.means
    local = camera_space(job.camera, torch.where(means.abs() < LARGEST, means, 0.0))
    seen = local[:, 2:] > job.settings.near_depth
    local = torch.where(seen, local, 1.0)
    return local[:, 2], to_pixels(job.camera, local)


def _median_depth(
    depth: Float[Tensor, " n"], nearest: Int32[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Z of the Gaussians at these indices; 0 where the index is -1."""
    return torch.cat([depth, depth.new_zeros(1)])[nearest.long()]
