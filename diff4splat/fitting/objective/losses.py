"""Image losses of a rendered frame: colour, SSIM, depth and optical flow.

Axes: ``h w`` pixels. Colour is the mean absolute error, the only image loss of Wu et al. 2024.
SSIM follows Kerbl et al. 2023. Depth is the absolute disparity error in units of the mean
disparity. Flow is the end-point error in image widths. Masked pixels enter no term.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Flow, Frame
from diff4splat.fitting.settings import LossWeights
from diff4splat.metrics.ssim import WINDOW_PX, ssim
from diff4splat.render.physical.settings import Photograph
from diff4splat.render.settings import RenderOutput


def image_loss(
    rendered: RenderOutput | Photograph, frame: Frame, weights: LossWeights
) -> Float[Tensor, ""]:
    """Weighted sum of the terms whose outputs ``rendered`` has."""
    mask = frame.counts
    rgb = rendered.rgb
    if mask is not None:
        # Masked pixels equal the ground truth, so they add no error and no gradient to SSIM.
        rgb = torch.where(mask[..., None], rgb, frame.rgb)
    total = color_loss(rgb, frame.rgb, mask)
    if weights.ssim and min(rgb.shape[:2]) >= WINDOW_PX:
        total = total + weights.ssim * (1 - ssim(rgb, frame.rgb))
    if rendered.depth is not None and frame.depth is not None:
        total = total + weights.depth * depth_loss(rendered.depth, frame.depth, mask)
    return total


def color_loss(
    rgb: Float[Tensor, "h w 3"], target: Float[Tensor, "h w 3"], mask: Bool[Tensor, "h w"] | None
) -> Float[Tensor, ""]:
    """Mean absolute error over the pixels in ``mask``; 0 for an empty mask."""
    if mask is None:
        return (rgb - target).abs().mean()
    return (rgb - target).abs()[mask].sum() / (3 * mask.sum()).clamp_min(1)


def depth_loss(
    depth: Float[Tensor, "h w"], target: Float[Tensor, "h w"], mask: Bool[Tensor, "h w"] | None
) -> Float[Tensor, ""]:
    """Mean |1/z − 1/z'| in units of the mean 1/z', over pixels with depth in both images."""
    valid = (target > 0) & (depth > 0)
    if mask is not None:
        valid = valid & mask
    if not bool(valid.any()):
        return depth.sum() * 0
    disparity = 1 / target[valid]
    return (1 / depth[valid] - disparity).abs().mean() / disparity.mean()


def flow_loss(flow: Float[Tensor, "h w 2"], target: Flow) -> Float[Tensor, ""]:
    """Mean end-point error in image widths, over pixels with ground truth."""
    if not bool(target.known.any()):
        return flow.sum() * 0
    error = (flow - target.offset_px)[target.known]
    return (error.square().sum(-1) + 1e-12).sqrt().mean() / flow.shape[1]
