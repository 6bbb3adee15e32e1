"""Parts of a kernel's work on as many threads as PyTorch uses.

Kernels release Python's lock, so plain threads do. Each takes the next part when it is free; the
parts never depend on the number of threads, so neither does any result.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from threading import Lock

import torch


def spread(work: Callable[..., None], parts: Iterable[tuple]) -> None:
    """Call ``work(*part)`` for every part; returns when no thread works any more.

    ``work`` must not call it again: all threads might wait for each other.

    Raises:
        Exception: what any of the calls raised; parts that nobody has begun are left out then.
    """
    waiting, lock = list(parts)[::-1], Lock()

    def take() -> None:
        while True:
            with lock:
                if not waiting:
                    return
                part = waiting.pop()
            work(*part)

    helpers = min(torch.get_num_threads(), len(waiting)) - 1
    running = [_pool(helpers, os.getpid()).submit(take) for _ in range(helpers)]
    try:
        take()
    finally:
        with lock:
            waiting.clear()
        # Those that are queued behind another picture have nothing left to do.
        started = [helper for helper in running if not helper.cancel()]
        wait(started)
    for helper in started:
        helper.result()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that live as long as the process; a forked one starts its own."""
    del process
    return ThreadPoolExecutor(threads, thread_name_prefix="diff4splat-raster")


def ranges(count: int, size: int) -> list[tuple[int, int]]:
    """(first, one past last) of pieces of at most ``size``."""
    return [(first, min(first + size, count)) for first in range(0, count, size)]
