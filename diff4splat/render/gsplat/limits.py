"""Jobs that gsplat cannot do, whichever version is installed; nothing here loads it.

Every function answers "expected X, got Y", or None where the job is within the limit.
"""

import torch

from diff4splat.render.projection import camera_space
from diff4splat.render.settings import RenderJob

DEVICE_TYPE = "cuda"
SUPPORTED_OUTPUTS = ("rgb", "depth", "alpha", "flow", "features")
FIXED = {
    "alpha_cutoff": (1 / 255,),
    "light_cutoff": (1e-4, None),
    "tile_px": (16, None),
}
"""What the kernels hold constant, and the defaults that leave it to them."""
WIDEST_PX = 1e8
"""The radii of much wider footprints overflow the 32-bit integers that hold them."""
LARGEST = torch.finfo(torch.float32).max ** 0.5
"""Gaussians with larger numbers are left out anyway."""


def tensor_limit(job: RenderJob) -> str | None:
    """Float32 on a GPU."""
    means = job.gaussians.means
    if means.device.type != DEVICE_TYPE:
        return f"expected a {DEVICE_TYPE.upper()} tensor, got {means.device.type}"
    if means.dtype != torch.float32:
        return f"expected float32, got {means.dtype}"
    return None


def output_limit(job: RenderJob) -> str | None:
    """Sums over Gaussians, but no medians."""
    other = sorted(job.outputs - set(SUPPORTED_OUTPUTS))
    if other:
        return f"expected outputs among {', '.join(SUPPORTED_OUTPUTS)}, got {', '.join(other)}"
    return None


def setting_limit(job: RenderJob) -> str | None:
    """Constants of the kernels."""
    for name, accepted in FIXED.items():
        got = getattr(job.settings, name)
        if got not in accepted:
            return f"expected {name} {accepted[0]:.6g}, which gsplat fixes, got {got:.6g}"
    return None


def gradient_limit(job: RenderJob) -> str | None:
    """The pose gets gradients, the lens none."""
    camera = job.camera
    if torch.is_grad_enabled() and (
        camera.focal_px.requires_grad or camera.center_px.requires_grad
    ):
        return "expected focal_px and center_px that need no gradient, got requires_grad"
    return None


@torch.no_grad()
def range_limit(job: RenderJob) -> str | None:
    """Numbers that the kernels cannot hold; this one waits for the GPU."""
    gaussians = job.gaussians
    depth = camera_space(job.camera, gaussians.means)[:, 2]
    table = torch.stack([gaussians.scales.amax(-1), gaussians.opacities], -1)
    drawn = (depth > job.settings.near_depth) & (table < LARGEST).all(-1)
    table = torch.where(drawn[:, None], table, 0.0)
    table[:, 0] *= job.camera.focal_px.amax() / torch.where(drawn, depth, 1.0)
    widest_px, most_opaque = torch.cat([table, table.new_zeros(1, 2)]).amax(0).tolist()
    if widest_px > WIDEST_PX:
        return f"expected footprints below {WIDEST_PX:.0e} px, got {widest_px:.0e} px"
    if most_opaque > 1:
        return f"expected opacities of at most 1, got {most_opaque:.6g}"
    return None
