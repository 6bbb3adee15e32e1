"""How kernels are compiled: once per machine, kept on disk, free of Python's lock.

A ``kernel`` is called from Python, a ``device`` function from kernels. Products and sums may be
contracted to fused ones; nothing else is reordered, so equal inputs give equal bits.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    # Test hooks wrap functions to check their annotations; kernels need the bare one.
    bare = inspect.unwrap(function)
    try:
        compiled = njit(cache=True, **_OPTIONS)(bare)
    except RuntimeError:
        # No folder to write to: every process compiles for itself.
        compiled = njit(**_OPTIONS)(bare)
    KERNELS.append(compiled)
    return compiled


def device(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into the kernels that call it.

    Always inlined: a call passes arrays by counted references, which costs more than most work.
    """
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


def is_ready(compiled: Any) -> bool:
    """Whether a kernel was compiled before, in this process or on this machine."""
    if compiled.signatures:
        return True
    folder = compiled.stats.cache_path
    name = compiled.py_func.__qualname__
    module = Path(inspect.getfile(compiled.py_func)).stem
    return folder is not None and any(Path(folder).glob(f"{module}.{name}-*.nbi"))
