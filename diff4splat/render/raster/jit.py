"""How the rasteriser's kernels are compiled: fast, free of Python's lock, the same bits every time.

A ``kernel`` is called from Python, a ``device`` function from kernels. Products and sums may be
contracted to fused ones; nothing else is reordered, so equal inputs give equal bits.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from diff4splat.jit import kept

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}

SOURCES = Path(__file__).parent

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    compiled = kept(function, _OPTIONS, SOURCES)
    KERNELS.append(compiled)
    return compiled


def device(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into the kernels that call it.

    Always inlined: a call passes arrays by counted references, which costs more than most work.
    """
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


def exact(function: Callable[..., Any]) -> Any:
    """As ``device``, without fused operations: kernels that must decide alike share it."""
    options = {name: value for name, value in _OPTIONS.items() if name != "fastmath"}
    return njit(forceinline=True, **options)(inspect.unwrap(function))
