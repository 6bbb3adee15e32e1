"""Groups of kernels: one per area, with the same compiler options and one warm-up.

Kernels compile on their first call and are loaded from disk afterwards. A warm-up calls every
kernel of its group once, so that this can happen ahead of use and visibly.
"""

import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any

import torch

from diff4splat.kernels.console import compile_with_progress
from diff4splat.kernels.jit import cached_njit, is_compiled, on_compile

_TOOLKIT = Path(__file__).parent


class KernelGroup:
    """The kernels of one area.

    Args:
        title: what the kernels do, for people: "the CPU renderer".
        options: those of ``numba.njit``.
        sources: folders with all code that the kernels call, besides this package.
        warm_up: dotted name of the module whose function ``warm_up()`` calls every kernel. It is
            imported late, because it imports the kernels.
        compile_s: seconds that compiling takes on a laptop.
    """

    def __init__(
        self,
        title: str,
        *,
        options: dict[str, Any],
        sources: tuple[Path, ...],
        warm_up: str,
        compile_s: int,
    ) -> None:
        self.title, self.compile_s = title, compile_s
        self._options, self._sources, self._warm_up = options, (*sources, _TOOLKIT), warm_up
        self._listed: list[Any] = []
        self._lock, self._is_ensured = Lock(), False

    def kernel(self, function: Callable[..., Any]) -> Any:
        """Compile ``function`` on its first call, cache it on disk, and add it to the group."""
        compiled = cached_njit(function, self._options, *self._sources)
        self._listed.append(compiled)
        return compiled

    @property
    def kernels(self) -> list[Any]:
        """All kernels of the group; imports the modules that define them."""
        import_module(self._warm_up)
        return self._listed

    def kernel_count(self) -> int:
        """How many kernels `precompile` prepares."""
        return len(self.kernels)

    def is_ready(self) -> bool:
        """Whether every kernel is compiled, in this process or in the cache on disk."""
        return all(map(is_compiled, self.kernels))

    def precompile(self, on_kernel: Callable[[str], None] = lambda name: None) -> float:
        """Load or compile every kernel; ``on_kernel`` gets the names of the compiled ones.

        Returns the seconds.
        """
        began, warm_up = time.perf_counter(), import_module(self._warm_up).warm_up
        with (
            on_compile(self._listed, on_kernel),
            torch.inference_mode(False),
            torch.enable_grad(),
        ):
            warm_up()
        return time.perf_counter() - began

    def ensure_compiled(self) -> None:
        """Compile once per process, if necessary, and report it on the error stream."""
        with self._lock:
            if not self._is_ensured and not self.is_ready():
                compile_with_progress(self.title, self.precompile)
            self._is_ensured = True
