"""The reference renderer: plain PyTorch, float32 or float64, any device, differentiable throughout.

Axes: ``n`` Gaussians nearest first, ``h w`` pixels, ``c`` channels. It is the oracle of every
faster back end, and the fallback where none of them can run. It looks through every Gaussian of a
pixel, whatever light is left.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.render.channels import extra_channels, name_outputs
from diff4splat.render.compositing import composite
from diff4splat.render.projection import footprints
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.render.support import visible_order
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians


def unsupported_reason(job: RenderJob) -> str | None:
    """None: there is nothing that this back end cannot do."""
    del job


def render(job: RenderJob) -> RenderOutput:
    """Make the images that ``job`` asks for."""
    with torch.autocast(job.gaussians.means.device.type, enabled=False):
        order, dropped = visible_order(job.gaussians, job.camera, job.settings)
        visible = job.gaussians.select(order)
        prints = footprints(visible, job.camera, job.settings)
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


def _colors(job: RenderJob, visible: Gaussians) -> Float[Tensor, "n 3"]:
    """RGB seen from the camera centre; plain colours need no directions."""
    directions = visible.means - job.camera.position
    if visible.degree > 0:
        directions = torch.nn.functional.normalize(directions, dim=-1)
    return harmonics.color(visible.sh, directions)
