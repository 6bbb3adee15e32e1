"""Compilation ahead of use: visible, once per machine.

Kernels compile when they are first called and are then loaded from disk. One ray that looks at one
Gaussian, forwards and backwards, calls each of them once.
"""

import sys
import time
from collections.abc import Callable
from functools import cache
from threading import Lock

import torch

from diff4splat.render.raster import jit
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
    began = time.perf_counter()
    with jit.announced(KERNELS, advance), torch.inference_mode(False), torch.enable_grad():
        _trace_one_ray()
    return time.perf_counter() - began


def ensure_compiled() -> None:
    """Before the first rays of a process: say so if kernels must be compiled, and do it."""
    with _ONE_AT_A_TIME:
        _compile_once()


@cache
def _compile_once() -> None:
    if is_ready():
        return
    _show("diff4splat: compiling the ray tracer, once for this machine:")
    seconds = warm(lambda name: _show(f" {name}"))
    _show(f"\ndiff4splat: ready after {seconds:.0f} s; later runs load it from disk\n")


def _show(text: str) -> None:
    # A program without a console has no error stream.
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()


def _trace_one_ray() -> None:
    zero, ahead = torch.zeros(1, 3, device="cpu"), torch.tensor([[0.0, 0.0, 1.0]], device="cpu")
    gaussian = Gaussians(
        means=ahead.float(),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], device="cpu"),
        scales=torch.full((1, 3), 0.1, device="cpu"),
        opacities=torch.full((1,), 0.5, device="cpu").requires_grad_(),
        sh=torch.zeros(1, 4, 3, device="cpu"),
    )
    now = torch.zeros(1, device="cpu")
    rays = Rays(origins=zero, directions=ahead, time_s=now)
    moving = MovingCloud(velocities=zero, time_centers_s=now, time_deviations_s=now + 1)
    look(gaussian, rays, TraceSettings(), moving).light.sum().backward()
