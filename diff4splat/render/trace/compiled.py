"""How the tracer's kernels are compiled: as the rasteriser's, with a list of their own.

A ``kernel`` is called from Python. A ``shared`` function is compiled once for all kernels that call
it, without fused operations, so that the way back decides as the way forward did.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from diff4splat.jit import kept
from diff4splat.render.raster.jit import SOURCES

_OPTIONS = {"nogil": True, "error_model": "numpy"}

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    compiled = kept(function, _OPTIONS, Path(__file__).parent, SOURCES)
    KERNELS.append(compiled)
    return compiled


def shared(function: Callable[..., Any]) -> Any:
    """Compile ``function`` once, however many kernels call it."""
    return njit(**_OPTIONS)(inspect.unwrap(function))
