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
        try:
            while part := _next(waiting, lock):
                work(*part)
        finally:
            # Nothing is left but after an error: then nobody begins another part.
            with lock:
                waiting.clear()

    allowed = torch.get_num_threads() - 1
    helpers = min(allowed, len(waiting) - 1)
    running = [_pool(allowed, os.getpid()).submit(take) for _ in range(helpers)]
    try:
        take()
    finally:
        # Those that are queued behind another picture have nothing left to do.
        started = [helper for helper in running if not helper.cancel()]
        wait(started)
    for helper in started:
        helper.result()


def _next(waiting: list[tuple], lock: Lock) -> tuple:
    """The next part, or an empty one."""
    with lock:
        return waiting.pop() if waiting else ()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that live as long as the process; a forked one starts its own."""
    del process
    return ThreadPoolExecutor(threads, thread_name_prefix="diff4splat-raster")


def ranges(count: int, size: int) -> list[tuple[int, int]]:
    """(first, one past last) of pieces of at most ``size``."""
    return [(first, min(first + size, count)) for first in range(0, count, size)]
