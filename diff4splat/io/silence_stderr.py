"""Silence for C libraries that print to the console what we report ourselves."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silence_native_stderr() -> Iterator[None]:
    """Send file descriptor 2 to nowhere for the length of the block."""
    try:
        kept = os.dup(2)
    except OSError:  # a service may run with no stderr at all
        yield
        return
    sys.stderr.flush()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)
