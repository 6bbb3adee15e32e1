"""How kernels are kept: compiled once per machine, on disk, under a digest of their sources.

Each package of kernels has a module of its own that says with which options they are compiled.
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


def kept(function: Callable[..., Any], options: dict[str, Any], *sources: Path) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed.

    ``options`` are those of ``numba.njit``; ``sources`` as for `cache_folder`.
    """
    # Test hooks wrap functions to check their annotations; kernels need the bare one.
    bare, before = inspect.unwrap(function), config.CACHE_DIR
    compiled = njit(**options)(bare)
    # Where no folder can be written to, every process compiles for itself.
    with suppress(OSError, RuntimeError):
        config.CACHE_DIR = str(cache_folder(*sources))
        compiled._cache = _Kept(bare)
    config.CACHE_DIR = before
    return compiled


class _Kept(FunctionCache):
    """Kernels on disk, as Numba keeps them; a full disk costs time, and not the run."""

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, if there is room for it."""
        with suppress(OSError):
            super().save_overload(sig, data)


@cache
def cache_folder(*sources: Path) -> Path:
    """Where compiled kernels are kept: under ``NUMBA_CACHE_DIR``, or the user's cache.

    Its name is a digest of all files in the folders ``sources``, of Numba, Python and the
    processor. Numba by itself notices a change of the file that holds a kernel, and not of the
    functions that the kernel takes from other files.

    Raises:
        OSError: it cannot be made or written to.
    """
    machine = (numba.__version__, sys.version_info[:2], llvmlite.binding.get_host_cpu_name())
    digest = hashlib.sha256(repr(machine).encode())
    for folder in sources:
        for file in sorted(folder.glob("*.py")):
            digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    base = os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "diff4splat" / "kernels"
    folder = Path(base) / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"{folder}: expected a folder to write to")
    return folder


def is_ready(compiled: Any) -> bool:
    """Whether a kernel was compiled before, in this process or on this machine."""
    if compiled.signatures:
        return True
    folder = compiled.stats.cache_path
    name = compiled.py_func.__qualname__
    module = Path(inspect.getfile(compiled.py_func)).stem
    return folder is not None and any(Path(folder).glob(f"{module}.{name}-*.nbi"))


@contextmanager
def announced(kernels: list[Any], advance: Callable[[str], None]) -> Iterator[None]:
    """Tell ``advance`` the name of each of the ``kernels`` when it has been compiled."""
    with event.install_listener("numba:compile", _Names(kernels, advance)):
        yield


class _Names(event.Listener):
    """Reports kernels as their compilation ends, and not the functions inside them."""

    def __init__(self, kernels: list[Any], advance: Callable[[str], None]) -> None:
        self._kernels, self._advance = kernels, advance

    def on_start(self, event: Any) -> None:
        """Nothing to say yet."""

    def on_end(self, event: Any) -> None:
        """One more is ready."""
        dispatcher = event.data["dispatcher"]
        if any(dispatcher is kernel for kernel in self._kernels):
            self._advance(dispatcher.py_func.__name__)
