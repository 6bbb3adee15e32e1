"""Decorators that compile functions with Numba, and the on-disk cache of compiled kernels.

Python calls a kernel; kernels call `inlined`, `contracted`, `merged` and `shared` functions. All of
them release Python's lock. Floating-point operations are never reordered, so equal inputs give
equal bits.
"""

import hashlib
import inspect
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba import config, njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

from diff4splat.kernels.verified_cache import VerifiedCacheFile

EXACT = {"nogil": True, "error_model": "numpy"}
"""Options of ``numba.njit``: every operation rounds."""
CONTRACTED = {**EXACT, "fastmath": {"contract"}}
"""The same, but a product and a sum may become one fused operation."""


def inlined(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into every caller, without fused operations.

    All callers get the same bits, so kernels that must take equal decisions share it. A call would
    pass arrays by counted references, which costs more than most functions do.
    """
    return njit(forceinline=True, **EXACT)(inspect.unwrap(function))


def contracted(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into every caller; fused operations are allowed."""
    return njit(forceinline=True, **CONTRACTED)(inspect.unwrap(function))


def merged(function: Callable[..., Any]) -> Any:
    """Put ``function`` into its one caller before anything is compiled.

    A large `inlined` function is optimised twice, alone and in its caller, which nearly doubles the
    compile time. Small functions compile faster when `inlined`.
    """
    return njit(inline="always", **EXACT)(inspect.unwrap(function))


def shared(function: Callable[..., Any]) -> Any:
    """Compile ``function`` once for all kernels of a module that call it."""
    return njit(**EXACT)(inspect.unwrap(function))


def cached_njit(function: Callable[..., Any], options: dict[str, Any], *sources: Path) -> Any:
    """Compile ``function`` on its first call, and cache the result on disk where possible.

    ``options`` are those of ``numba.njit``; ``sources`` as for `cache_folder`.
    """
    # Test hooks wrap functions to check their annotations; Numba needs the function itself.
    bare, before = inspect.unwrap(function), config.CACHE_DIR
    compiled = njit(**options)(bare)
    # Without a writable folder, every process compiles for itself.
    with suppress(OSError, RuntimeError):
        config.CACHE_DIR = str(cache_folder(*sources))
        compiled._cache = _DiskCache(bare)
    config.CACHE_DIR = before
    return compiled


class _DiskCache(FunctionCache):
    """Numba's cache, but loading skips what only compiling needs, and no disk stops a run."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = VerifiedCacheFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load a compiled kernel; the registries of the compiler are loaded when it compiles."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a compiled kernel if there is room for it."""
        with suppress(OSError):
            super().save_overload(sig, data)


@cache
def cache_folder(*sources: Path) -> Path:
    """Folder of compiled kernels: below ``NUMBA_CACHE_DIR``, or in the user's cache.

    Its name is a digest of all Python files below the folders ``sources``, of Numba, Python and the
    processor. Numba itself notices a change only in the file that defines a kernel, not in files
    that define functions which the kernel calls.

    Raises:
        OSError: the folder cannot be created or written to.
    """
    machine = (numba.__version__, sys.version_info[:2], llvmlite.binding.get_host_cpu_name())
    digest = hashlib.sha256(repr(machine).encode())
    for folder in sources:
        for file in sorted(folder.rglob("*.py")):
            digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    base = os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "diff4splat" / "kernels"
    folder = Path(base) / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"{folder}: expected a folder to write to")
    return folder


def is_compiled(kernel: Any) -> bool:
    """Whether ``kernel`` is compiled, in this process or in the cache on disk."""
    if kernel.signatures:
        return True
    folder = kernel.stats.cache_path
    name = kernel.py_func.__qualname__
    module = Path(inspect.getfile(kernel.py_func)).stem
    return folder is not None and any(Path(folder).glob(f"{module}.{name}-*.nbi"))


@contextmanager
def on_compile(kernels: list[Any], callback: Callable[[str], None]) -> Iterator[None]:
    """Call ``callback`` with the name of each of the ``kernels`` after its compilation."""
    with event.install_listener("numba:compile", _CompileListener(kernels, callback)):
        yield


class _CompileListener(event.Listener):
    """Reports kernels when their compilation ends, but not the functions inside them."""

    def __init__(self, kernels: list[Any], callback: Callable[[str], None]) -> None:
        self._kernels, self._callback = kernels, callback

    def on_start(self, event: Any) -> None:
        """Do nothing."""

    def on_end(self, event: Any) -> None:
        """Report the kernel."""
        dispatcher = event.data["dispatcher"]
        if any(dispatcher is kernel for kernel in self._kernels):
            self._callback(dispatcher.py_func.__name__)
