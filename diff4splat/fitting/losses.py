"""What a rendered picture should agree with: colours, structure, depth and flow of a frame.

Axes: ``h w`` pixels. Colours by mean absolute error (Wu et al. 2024 use nothing else), SSIM as
Kerbl et al. 2023, depth by the absolute error of disparity in units of its mean, flow in pixels per
picture width. Pixels that do not count have no part in any of them.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Flow, Frame
from diff4splat.fitting.settings import Weights
from diff4splat.metrics.ssim import WINDOW_PX, ssim
from diff4splat.render.physical.settings import Photograph
from diff4splat.render.settings import RenderOutput


def picture_loss(
    made: RenderOutput | Photograph, frame: Frame, weights: Weights
) -> Float[Tensor, ""]:
    """All weighted terms that ``made`` has outputs for."""
    counts = frame.counts
    rgb = made.rgb
    if counts is not None:
        # Where nothing counts the picture is its own truth: no error, and no gradient.
        rgb = torch.where(counts[..., None], rgb, frame.rgb)
    total = color_loss(rgb, frame.rgb, counts)
    if weights.ssim and min(rgb.shape[:2]) >= WINDOW_PX:
        total = total + weights.ssim * (1 - ssim(rgb, frame.rgb))
    if made.depth is not None and frame.depth is not None:
        total = total + weights.depth * depth_loss(made.depth, frame.depth, counts)
    return total


def color_loss(
    rgb: Float[Tensor, "h w 3"], truth: Float[Tensor, "h w 3"], counts: Bool[Tensor, "h w"] | None
) -> Float[Tensor, ""]:
    """Mean absolute error over the pixels that count; 0 where none does."""
    if counts is None:
        return (rgb - truth).abs().mean()
    return (rgb - truth).abs()[counts].sum() / (3 * counts.sum()).clamp_min(1)


def depth_loss(
    depth: Float[Tensor, "h w"], truth: Float[Tensor, "h w"], counts: Bool[Tensor, "h w"] | None
) -> Float[Tensor, ""]:
    """Mean |1/z − 1/z'| in units of the mean 1/z', where both pictures have depth."""
    known = (truth > 0) & (depth > 0)
    if counts is not None:
        known = known & counts
    if not bool(known.any()):
        return depth.sum() * 0
    wanted = 1 / truth[known]
    return (1 / depth[known] - wanted).abs().mean() / wanted.mean()


def flow_loss(flow: Float[Tensor, "h w 2"], truth: Flow) -> Float[Tensor, ""]:
    """Mean end-point error in picture widths where the truth is known."""
    if not bool(truth.known.any()):
        return flow.sum() * 0
    gap = (flow - truth.offset_px)[truth.known]
    return (gap.square().sum(-1) + 1e-12).sqrt().mean() / flow.shape[1]
