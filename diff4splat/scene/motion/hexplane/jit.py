"""How kernels are compiled: once per machine, kept on disk, free of Python's lock.

Products and sums may be contracted to fused ones; nothing else is reordered, so equal inputs give
equal bits.
"""

import hashlib
import inspect
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import torch
from numba import config, njit

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    # Test hooks wrap functions to check their annotations; kernels need the bare one.
    bare, before = inspect.unwrap(function), config.CACHE_DIR
    try:
        config.CACHE_DIR = str(cache_folder())
        return njit(cache=True, **_OPTIONS)(bare)
    except (OSError, RuntimeError):
        # No folder to write to: every process compiles for itself.
        return njit(**_OPTIONS)(bare)
    finally:
        config.CACHE_DIR = before


def device(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into the kernels that call it; always inlined."""
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


@cache
def cache_folder() -> Path:
    """Where compiled kernels are kept: under ``NUMBA_CACHE_DIR``, or the user's cache.

    Its name is a digest of all sources here, of Numba, Python and the processor: Numba by itself
    does not notice a change of the functions that a kernel takes from other files.

    Raises:
        OSError: it cannot be made or written to.
    """
    machine = (numba.__version__, sys.version_info[:2], llvmlite.binding.get_host_cpu_name())
    digest = hashlib.sha256(repr(machine).encode())
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    base = os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "diff4splat" / "kernels"
    folder = Path(base) / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"{folder}: expected a folder to write to")
    return folder


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
