"""The back end ``raster``: float32 on CPUs, compiled on first use.

Axes: ``n`` Gaussians, ``k`` harmonics, ``h w`` pixels, ``c`` channels.
"""

from collections.abc import Callable
from dataclasses import fields
from importlib.util import find_spec
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float, Int32
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.channels import extra_channels, name_outputs
from diff4splat.render.projection import pixels_in_front
from diff4splat.render.raster.raster_settings import TILE_SIZES_PX, make_raster_settings
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

if TYPE_CHECKING:
    from diff4splat.render.raster.function import Raster

_SHARED_OUTPUTS = {"rgb", "alpha", "depth", "median_depth"}
_MOST_GAUSSIANS = 1 << 24
"""Beyond it float32 cannot number the entries of a list."""


def unsupported_reason(job: RenderJob) -> str | None:
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
    """Render the outputs of ``job``."""
    # Numba is loaded with the first image, not with the library.
    from diff4splat.render.raster.function import rasterize
    from diff4splat.render.raster.jit import GROUP

    GROUP.ensure_compiled()
    medians = "median_depth" in job.outputs
    with torch.autocast("cpu", enabled=False):
        depth, extras = _depth_and_extras(job)
        plan = make_raster_settings(
            job.camera, job.settings, "rgb" in job.outputs, medians, extras.shape[1]
        )
        raster = rasterize(plan, job.gaussians, extras, job.camera)
        median_depth = _median_depth(depth, raster.medians[0]) if medians else None
        return _named(job, raster, median_depth)


def open_sequence(scene: Scene, job: RenderJob) -> Callable[[Camera, float], RenderOutput] | None:
    """A renderer of ``scene`` that shares work between frames, or None if that is impossible.

    ``job`` is the first of them. Flow and features are not shared, and gradients need each state.
    """
    if not job.outputs <= _SHARED_OUTPUTS or _wants_gradient(job):
        return None
    from diff4splat.render.raster.jit import GROUP
    from diff4splat.render.raster.raster_settings import make_view
    from diff4splat.render.raster.sequence import Sequence

    GROUP.ensure_compiled()
    medians = "median_depth" in job.outputs
    depths = "depth" in job.outputs
    plan = make_raster_settings(
        job.camera, job.settings, "rgb" in job.outputs, medians, 2 if depths else 0
    )
    sequence = Sequence(scene, plan, depths)

    def draw(camera: Camera, time_s: float) -> RenderOutput:
        view = make_view(plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px)
        raster = sequence.draw(view, time_s)
        median_depth = _median_depth(sequence.depth, raster.medians[0]) if medians else None
        return _named(job, raster, median_depth)

    return draw


def open_view(job: RenderJob) -> Callable[[Float[Tensor, "n k 3"]], RenderOutput]:
    """A renderer of the colours of ``job`` with other harmonics, without gradients."""
    from diff4splat.render.raster.fixed_view import FixedView
    from diff4splat.render.raster.jit import GROUP

    GROUP.ensure_compiled()
    plan = make_raster_settings(job.camera, job.settings, colors=True, medians=False)
    view = FixedView(plan, job.gaussians, job.camera, job.settings.memory_bytes)
    return lambda sh: _named(job, view.draw(sh), None)


def _wants_gradient(job: RenderJob) -> bool:
    """Whether any input needs a gradient; for a motion, its state decides."""
    camera = job.camera
    tensors = [
        *(getattr(job.gaussians, f.name) for f in fields(job.gaussians)),
        *(camera.world_from_camera, camera.focal_px, camera.center_px),
    ]
    if isinstance(job.settings.background, Tensor):
        tensors.append(job.settings.background)
    return torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)


def _named(
    job: RenderJob, raster: "Raster", median_depth: Float[Tensor, "h w"] | None
) -> RenderOutput:
    counts = zip((f.name for f in fields(Gaussians)), raster.unusable, strict=True)
    dropped = {name: count for name, count in counts if count}
    return name_outputs(job, raster.planes.permute(1, 2, 0), raster.light, median_depth, dropped)


def _depth_and_extras(job: RenderJob) -> tuple[Float[Tensor, " n"], Float[Tensor, "n c"]]:
    """Depth of the means and the channels beside the colours; none where only those are wanted."""
    means = job.gaussians.means
    if job.outputs <= {"rgb", "alpha"}:
        return means.new_zeros(len(means)), means.new_zeros(len(means), 0)
    # Who is near is decided in float64 by the kernel; here only the numbers shall be finite.
    near_depth = 0.5 * job.settings.near_depth
    center_px, depth, _ = pixels_in_front(job.camera, means, near_depth)
    moved, features = job.flow_gaussians.means, job.settings.features
    return depth, extra_channels(job, depth, center_px, moved, features)


def _median_depth(
    depth: Float[Tensor, " n"], nearest: Int32[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Z of the Gaussians at these indices; 0 where the index is -1."""
    return torch.cat([depth, depth.new_zeros(1)])[nearest.long()]
