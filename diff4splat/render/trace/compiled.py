"""How the tracer's kernels are compiled: as the rasteriser's, with a list of their own.

A ``kernel`` is called from Python. A ``shared`` function is compiled once for all kernels that call
it, without fused operations, so that the way back decides as the way forward did.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import config, njit

from diff4splat.render.raster.jit import cache_folder

_OPTIONS = {"nogil": True, "error_model": "numpy"}

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    # Test hooks wrap functions to check their annotations; kernels need the bare one.
    bare, before = inspect.unwrap(function), config.CACHE_DIR
    try:
        config.CACHE_DIR = str(cache_folder(Path(__file__).parent))
        compiled = njit(cache=True, **_OPTIONS)(bare)
    except (OSError, RuntimeError):
        # No folder to write to: every process compiles for itself.
        compiled = njit(**_OPTIONS)(bare)
    finally:
        config.CACHE_DIR = before
    KERNELS.append(compiled)
    return compiled


def shared(function: Callable[..., Any]) -> Any:
    """Compile ``function`` once, however many kernels call it."""
    return njit(**_OPTIONS)(inspect.unwrap(function))
