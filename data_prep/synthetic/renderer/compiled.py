"""How the kernels here are compiled: to equal bits on every machine.

Nothing is fused or reordered, and no function of a mathematics library is called, so that a world
looks the same wherever it is drawn. A ``kernel`` is called from Python, ``inlined``, ``merged``
and ``shared`` functions from kernels; the last are compiled once however many places call them.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from diff4splat.jit import kept

_OPTIONS = {"nogil": True, "error_model": "numpy"}

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    compiled = kept(function, _OPTIONS, Path(__file__).parent)
    KERNELS.append(compiled)
    return compiled


def inlined(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into every place that calls it."""
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


def merged(function: Callable[..., Any]) -> Any:
    """Put ``function`` into its one caller before anything is compiled.

    A large function that is `inlined` would be optimised twice, alone and in its caller, which
    nearly doubles the time to compile all kernels. Small ones are found sooner when `inlined`.
    """
    return njit(inline="always", **_OPTIONS)(inspect.unwrap(function))


def shared(function: Callable[..., Any]) -> Any:
    """Compile ``function`` once for all kernels of a module that call it; scalars only."""
    return njit(**_OPTIONS)(inspect.unwrap(function))
