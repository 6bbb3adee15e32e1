"""How kernels are compiled: once per machine, kept on disk, free of Python's lock.

Products and sums may be contracted to fused ones; nothing else is reordered, so equal inputs give
equal bits.
"""

import inspect
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import torch
from numba import njit

from diff4splat.jit import kept

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    return kept(function, _OPTIONS, Path(__file__).parent)


def device(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into the kernels that call it; always inlined."""
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


def spread(work: Callable[..., None], parts: list[tuple]) -> None:
    """Call ``work(*part)`` for every part, on as many threads as PyTorch uses.

    The parts never depend on the number of threads, so neither does any result.
    """
    threads = torch.get_num_threads()
    if threads == 1 or len(parts) < 2:
        for part in parts:
            work(*part)
        return
    waiting = [_pool(threads, os.getpid()).submit(work, *part) for part in parts]
    for one in waiting:
        one.result()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that live as long as the process; a forked one starts its own."""
    del process
    return ThreadPoolExecutor(threads, thread_name_prefix="diff4splat-hexplane")
