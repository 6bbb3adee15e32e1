"""Compilation reported on the error stream, for a person who waits for it."""

import sys
from collections.abc import Callable


def compile_with_progress(title: str, precompile: Callable[[Callable[[str], None]], float]) -> None:
    """Call ``precompile`` and write the name of each compiled kernel to the error stream.

    ``precompile`` takes a callback for these names and returns the seconds.
    """
    _write(f"diff4splat: compiling {title}, once for this machine:")
    seconds = precompile(lambda name: _write(f" {name}"))
    _write(f"\ndiff4splat: ready after {seconds:.0f} s; later runs load it from disk\n")


def _write(text: str) -> None:
    # A program without a console has no error stream.
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()
