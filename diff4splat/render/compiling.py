"""Compilation of kernels ahead of use, timed and told to a person who waits."""

import sys
import time
from collections.abc import Callable
from typing import Any

import torch

from diff4splat import jit


def warmed(kernels: list[Any], advance: Callable[[str], None], use: Callable[[], None]) -> float:
    """Call ``use``, which needs all ``kernels`` and gradients; returns the seconds.

    ``advance`` hears the names of those that are compiled.
    """
    began = time.perf_counter()
    with jit.announced(kernels, advance), torch.inference_mode(False), torch.enable_grad():
        use()
    return time.perf_counter() - began


def compile_aloud(what: str, warm: Callable[[Callable[[str], None]], float]) -> None:
    """Compile, and say so on the error stream."""
    _show(f"diff4splat: compiling {what}, once for this machine:")
    seconds = warm(lambda name: _show(f" {name}"))
    _show(f"\ndiff4splat: ready after {seconds:.0f} s; later runs load it from disk\n")


def _show(text: str) -> None:
    # A program without a console has no error stream.
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()
