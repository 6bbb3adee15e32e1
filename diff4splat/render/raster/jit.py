"""How kernels are compiled: once per machine, kept on disk, free of Python's lock.

A ``kernel`` is called from Python, a ``device`` function from kernels. Products and sums may be
contracted to fused ones; nothing else is reordered, so equal inputs give equal bits.
"""

import hashlib
import inspect
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba import config, njit
from numba.core import event

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}

KERNELS: list[Any] = []
"""Every kernel of the modules loaded so far."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` when it is first called, and keep it on disk where that is allowed."""
    compiled = kept(function, _OPTIONS)
    KERNELS.append(compiled)
    return compiled


def kept(function: Callable[..., Any], options: dict[str, Any], *others: Path) -> Any:
    """Compile ``function`` when it is first called, and keep it in `cache_folder` of ``others``."""
    # Test hooks wrap functions to check their annotations; kernels need the bare one.
    bare, before = inspect.unwrap(function), config.CACHE_DIR
    try:
        config.CACHE_DIR = str(cache_folder(*others))
        return njit(cache=True, **options)(bare)
    except (OSError, RuntimeError):
        # No folder to write to: every process compiles for itself.
        return njit(**options)(bare)
    finally:
        config.CACHE_DIR = before


def device(function: Callable[..., Any]) -> Any:
    """Compile ``function`` into the kernels that call it.

    Always inlined: a call passes arrays by counted references, which costs more than most work.
    """
    return njit(forceinline=True, **_OPTIONS)(inspect.unwrap(function))


def exact(function: Callable[..., Any]) -> Any:
    """As ``device``, without fused operations: kernels that must decide alike share it."""
    options = {name: value for name, value in _OPTIONS.items() if name != "fastmath"}
    return njit(forceinline=True, **options)(inspect.unwrap(function))


@cache
def cache_folder(*others: Path) -> Path:
    """Where compiled kernels are kept: under ``NUMBA_CACHE_DIR``, or the user's cache.

    Its name is a digest of all sources here and in ``others`` (folders of other kernels), of Numba,
    Python and the processor. Numba by itself notices a change of the file that holds a kernel, and
    not of the functions that the kernel takes from other files.

    Raises:
        OSError: it cannot be made or written to.
    """
    machine = (numba.__version__, sys.version_info[:2], llvmlite.binding.get_host_cpu_name())
    digest = hashlib.sha256(repr(machine).encode())
    for sources in (Path(__file__).parent, *others):
        for file in sorted(sources.glob("*.py")):
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
