"""Silence C libraries that print errors which Python code already reports."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_LOCK = threading.RLock()
"""Two blocks at a time would restore each other's redirection."""


def separate_python_stderr() -> None:
    """Give ``sys.stderr`` a descriptor of its own: silenced blocks then take no line of Python's.

    Nothing changes in a process without standard error.
    """
    try:
        own = os.dup(2)
    except OSError:
        return
    encoding = sys.stderr.encoding
    sys.stderr = os.fdopen(own, "w", buffering=1, encoding=encoding, errors="backslashreplace")


@contextmanager
def silence_native_stderr(brief: bool = False) -> Iterator[None]:
    """Redirect file descriptor 2 to the null device inside the block.

    Other threads than the main one do so only for a ``brief`` block, in which at most one refresh
    of a progress bar is lost.
    """
    if not brief and threading.current_thread() is not threading.main_thread():
        yield
        return
    with _LOCK:
        yield from _redirected()


def _redirected() -> Iterator[None]:
    try:
        saved = os.dup(2)
    except OSError:  # a service may run with no stderr at all
        yield
        return
    sys.stderr.flush()
    null_device = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null_device, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(null_device)
        os.close(saved)
