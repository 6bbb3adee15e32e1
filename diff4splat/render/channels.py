"""What back ends blend beside colours, and what blended channels are called.

Axes: ``n`` Gaussians, ``h w`` pixels, ``c`` channels. The order of the channels is rgb (3), depth
(z, 1), flow (shift in pixels, 1 where both views see the Gaussian), features.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.render.projection import pixels_in_front
from diff4splat.render.settings import RenderJob, RenderOutput


def extra_channels(
    job: RenderJob,
    depth: Float[Tensor, " n"],
    center_px: Float[Tensor, "n 2"],
    moved: Float[Tensor, "n 3"],
    features: Float[Tensor, "n f"] | None,
) -> Float[Tensor, "n c"]:
    """All channels but the colours; ``moved`` are the means at the end of the flow."""
    channels = [depth.new_zeros(len(depth), 0)]
    if "depth" in job.outputs:
        channels.append(torch.stack([depth, torch.ones_like(depth)], -1))
    if "flow" in job.outputs:
        channels.append(_displacements(job, center_px, moved))
    if "features" in job.outputs and features is not None:
        channels.append(features)
    return torch.cat(channels, 1)


def name_outputs(
    job: RenderJob,
    blended: Float[Tensor, "h w c"],
    light: Float[Tensor, "h w"],
    median_depth: Float[Tensor, "h w"] | None,
    dropped: dict[str, int],
) -> RenderOutput:
    """The images asked for, with the background behind the colours."""
    widths = {"rgb": 3, "depth": 2, "flow": 3}
    parts, start = dict.fromkeys((*widths, "features")), 0
    for name, width in widths.items():
        if name in job.outputs:
            parts[name] = blended[..., start : start + width]
            start += width
    if "features" in job.outputs:
        parts["features"] = blended[..., start:]
    return RenderOutput(
        rgb=None if parts["rgb"] is None else _over_background(job, parts["rgb"], light),
        depth=None if parts["depth"] is None else _average(parts["depth"])[..., 0],
        flow=None if parts["flow"] is None else _average(parts["flow"]),
        features=parts["features"],
        median_depth=median_depth,
        alpha=1 - light if "alpha" in job.outputs else None,
        dropped_nonfinite=sum(dropped.values()),
        dropped_by_parameter=dropped,
    )


def _over_background(
    job: RenderJob, rgb: Float[Tensor, "h w 3"], light: Float[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    background = job.settings.background
    if not isinstance(background, Tensor):
        if not any(background):
            return rgb
        background = light.new_tensor(background)
    return rgb + light[..., None] * background.to(light)


def _displacements(
    job: RenderJob, start_px: Float[Tensor, "n 2"], moved: Float[Tensor, "n 3"]
) -> Float[Tensor, "n 3"]:
    """How far means move on the image, and 1; zeros for those the other view cannot see."""
    end_px, _, seen = pixels_in_front(job.flow_camera, moved, job.settings.near_depth)
    shift = torch.where(seen, end_px - start_px, 0.0)
    return torch.cat([shift, seen.to(shift)], -1)


def _average(sums: Float[Tensor, "h w c"]) -> Float[Tensor, "h w d"]:
    """Weighted means from (Σ w v, Σ w); 0 where there is no weight."""
    total = sums[..., -1:]
    return sums[..., :-1] / torch.where(total > 0, total, 1.0)
