"""Warm-up of the ray tracer's kernels: two rays with different origins towards one Gaussian."""

import torch

from diff4splat.render.trace.function import trace_compiled
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians


def warm_up() -> None:
    """Call every kernel of the ray tracer once, forward and backward."""
    zero, ahead = torch.zeros(1, 3, device="cpu"), torch.tensor([[0.0, 0.0, 1.0]], device="cpu")
    gaussian = Gaussians(
        means=ahead.float(),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], device="cpu"),
        scales=torch.full((1, 3), 0.1, device="cpu"),
        opacities=torch.full((1,), 0.5, device="cpu").requires_grad_(),
        sh=torch.zeros(1, 4, 3, device="cpu"),
    )
    now = torch.zeros(1, device="cpu")
    apart = torch.tensor([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]], device="cpu")
    rays = Rays(origins=apart, directions=ahead.expand(2, 3), time_s=now.expand(2))
    moving = MovingCloud(velocities=zero, time_centers_s=now, time_deviations_s=now + 1)
    trace_compiled(gaussian, rays, TraceSettings(), moving).light.sum().backward()
