"""Silence C libraries that print errors which Python code already reports."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silence_native_stderr() -> Iterator[None]:
    """Redirect file descriptor 2 to the null device inside the block.

    Other threads leave it as it is: they would silence progress bars of the main thread too.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
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
