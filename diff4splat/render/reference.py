"""The reference renderer: plain PyTorch, float32 or float64, any device, differentiable throughout.

Axes: ``n`` Gaussians nearest first, ``h w`` pixels, ``c`` channels. It is the oracle of every
faster back end, and the fallback where none of them can run.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.render.compositing import Composite, composite
from diff4splat.render.projection import camera_space, footprints, to_pixels
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.render.support import visible_order
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians


def refusal(job: RenderJob) -> str | None:
    """None: there is nothing that this back end cannot do."""
    del job


def render(job: RenderJob) -> RenderOutput:
    """Make the pictures that ``job`` asks for."""
    with torch.autocast(job.gaussians.means.device.type, enabled=False):
        order, dropped = visible_order(job.gaussians, job.camera, job.settings)
        visible = job.gaussians.select(order)
        prints = footprints(visible, job.camera, job.settings)
        channels = []
        if "rgb" in job.outputs:
            channels.append(_colors(job, visible))
        if "depth" in job.outputs:
            channels.append(torch.stack([prints.depth, torch.ones_like(prints.depth)], -1))
        if "flow" in job.outputs:
            channels.append(_displacements(job, order, prints.center_px))
        medians = "median_depth" in job.outputs
        table = torch.cat([prints.depth.new_zeros(len(visible), 0), *channels], 1)
        picture = composite(prints, table, job.camera.size_px, job.settings, medians)
        return _output(job, picture, [part.shape[1] for part in channels], dropped)


def _output(job: RenderJob, picture: Composite, widths: list[int], dropped: int) -> RenderOutput:
    """Name the blended channels, which come as rgb, depth, flow."""
    sums = iter(picture.blended.split(widths, -1))
    background = picture.light.new_tensor(job.settings.background)
    return RenderOutput(
        rgb=next(sums) + picture.light[..., None] * background if "rgb" in job.outputs else None,
        depth=_average(next(sums))[..., 0] if "depth" in job.outputs else None,
        flow=_average(next(sums)) if "flow" in job.outputs else None,
        median_depth=picture.median_depth if "median_depth" in job.outputs else None,
        alpha=1 - picture.light if "alpha" in job.outputs else None,
        dropped_nonfinite=dropped,
    )


def _colors(job: RenderJob, visible: Gaussians) -> Float[Tensor, "n 3"]:
    """RGB seen from the camera centre; plain colours need no directions."""
    directions = visible.means - job.camera.position
    if visible.degree > 0:
        directions = torch.nn.functional.normalize(directions, dim=-1)
    return harmonics.color(visible.sh, directions)


def _displacements(
    job: RenderJob, order: Int[Tensor, " n"], start_px: Float[Tensor, "n 2"]
) -> Float[Tensor, "n 3"]:
    """How far means move on the picture, and 1; zeros for those the other view cannot see."""
    moved = job.flow_gaussians.means[order]
    finite = torch.isfinite(moved).all(-1, keepdim=True)
    local = camera_space(job.flow_camera, torch.where(finite, moved, 0.0))
    seen = finite & (local[:, 2:] > job.settings.near_depth)
    local = torch.where(seen, local, 1.0)
    shift = torch.where(seen, to_pixels(job.flow_camera, local) - start_px, 0.0)
    return torch.cat([shift, seen.to(shift)], -1)


def _average(sums: Float[Tensor, "h w c"]) -> Float[Tensor, "h w d"]:
    """Weighted means from (Σ w v, Σ w); 0 where there is no weight."""
    total = sums[..., -1:]
    return sums[..., :-1] / torch.where(total > 0, total, 1.0)
