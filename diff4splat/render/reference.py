"""The reference renderer: plain PyTorch, float32 or float64, any device, differentiable throughout.

Axes: ``n`` Gaussians nearest first, ``h w`` pixels, ``c`` channels. It is the oracle of every
faster back end, and the fallback where none of them can run. It looks through every Gaussian of a
pixel, whatever light is left.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.render.channels import extra_channels, name_outputs
from diff4splat.render.compositing import composite
from diff4splat.render.projection import Footprints, footprints
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.render.support import pixel_boxes, visible_order
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

MOST_PAIRS, MOST_PAIRS_WITH_GRADIENT = 1e9, 2e8
"""Of a Gaussian and a pixel: some 15 seconds on two cores, and 3 GB with a gradient."""


def unsupported_reason(job: RenderJob) -> str | None:
    """None: there is nothing that this back end cannot do."""
    del job


def render(job: RenderJob) -> RenderOutput:
    """Make the images that ``job`` asks for."""
    with torch.autocast(job.gaussians.means.device.type, enabled=False):
        order, dropped = visible_order(job.gaussians, job.camera, job.settings)
        visible = job.gaussians.select(order)
        prints = footprints(visible, job.camera, job.settings)
        require_few_pairs(prints, job)
        features = job.settings.features
        channels = extra_channels(
            job,
            prints.depth,
            prints.center_px,
            job.flow_gaussians.means[order],
            None if features is None else features[order],
        )
        if "rgb" in job.outputs:
            channels = torch.cat([_colors(job, visible), channels], 1)
        medians = "median_depth" in job.outputs
        image = composite(prints, channels, job.camera.size_px, job.settings, medians)
        median_depth = image.median_depth if medians else None
        return name_outputs(job, image.blended, image.light, median_depth, dropped)


def require_few_pairs(prints: Footprints, job: RenderJob) -> None:
    """Refuse images that would take minutes or gigabytes.

    Raises:
        ConfigError: too many pairs of a Gaussian and a pixel of its box.
    """
    boxes = pixel_boxes(prints, job.camera.size_px, job.settings.alpha_cutoff).double()
    pairs = float((boxes[:, 2:] - boxes[:, :2]).clamp_min(0).prod(1).sum())
    most = MOST_PAIRS_WITH_GRADIENT if prints.center_px.requires_grad else MOST_PAIRS
    if pairs > most:
        raise ConfigError(
            f"backend 'reference': expected at most {most:.1g} pairs of a Gaussian and a "
            f"pixel, got {pairs:.1g}; use backend='raster' (float32 on a CPU) or a smaller image"
        )


def _colors(job: RenderJob, visible: Gaussians) -> Float[Tensor, "n 3"]:
    """RGB seen from the camera centre; plain colours need no directions."""
    directions = visible.means - job.camera.position
    if visible.degree > 0:
        directions = torch.nn.functional.normalize(directions, dim=-1)
    return harmonics.color(visible.sh, directions)
