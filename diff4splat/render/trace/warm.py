"""Compilation ahead of use: visible, once per machine.

Kernels compile when they are first called and are then loaded from disk. Two rays from different
places that look at one Gaussian, forwards and backwards, call each of them once.
"""

from collections.abc import Callable
from functools import cache
from threading import Lock

import torch

from diff4splat import jit
from diff4splat.render.compiling import compile_aloud, warmed
from diff4splat.render.trace.compiled import KERNELS
from diff4splat.render.trace.function import look
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

_ONE_AT_A_TIME = Lock()


def is_ready() -> bool:
    """Whether every kernel was compiled before, in this process or on this machine."""
    return all(map(jit.is_ready, KERNELS))


def kernel_count() -> int:
    """How many kernels `warm` goes through."""
    return len(KERNELS)


def warm(advance: Callable[[str], None] = lambda name: None) -> float:
    """Load or compile every kernel; ``advance`` hears the names of compiled ones.

    Returns the seconds.
    """
    return warmed(KERNELS, advance, _trace_two_rays)


def ensure_compiled() -> None:
    """Before the first rays of a process: say so if kernels must be compiled, and do it."""
    with _ONE_AT_A_TIME:
        _compile_once()


@cache
def _compile_once() -> None:
    if not is_ready():
        compile_aloud("the ray tracer", warm)


def _trace_two_rays() -> None:
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
    look(gaussian, rays, TraceSettings(), moving).light.sum().backward()
