"""The kernels of HexPlane fields as commands see them: compiled before they are needed."""

from collections.abc import Callable
from typing import Any

COMPILE_S = 2
"""Seconds that compiling takes on a laptop."""


def kernels() -> list[Any]:
    """Those that read features, and that take gradients back."""
    from diff4splat.scene.motion.hexplane.kernels import accumulate, read

    return [read, accumulate]


def is_ready() -> bool:
    """Whether every kernel was compiled before, in this process or on this machine."""
    from diff4splat.jit import is_ready as is_compiled

    return all(map(is_compiled, kernels()))


def kernel_count() -> int:
    """How many kernels `warm` goes through."""
    return len(kernels())


def warm(advance: Callable[[str], None] = lambda name: None) -> float:
    """Load or compile every kernel; ``advance`` hears the names of compiled ones.

    Returns the seconds.
    """
    from diff4splat.render.compiling import warmed

    return warmed(kernels(), advance, _read_one_point)


def _read_one_point() -> None:
    """Features of one point, and their gradients."""
    import torch

    from diff4splat.scene.motion.hexplane.compiled import features

    point = torch.zeros(1, 3, device="cpu", dtype=torch.float32, requires_grad=True)
    tables = [torch.zeros(2, 2, 16, device="cpu", dtype=torch.float32) for _ in range(6)]
    features(point, tables).sum().backward()
