"""A loop over parts of a kernel's work, on as many threads as PyTorch uses.

Kernels release Python's lock, so plain threads suffice. Each thread takes the next part when it is
free. The parts never depend on the number of threads, so neither does any result.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from threading import Lock

import torch


def parallel_for(work: Callable[..., None], parts: Iterable[tuple]) -> None:
    """Call ``work(*part)`` for every part; returns when all threads are idle.

    ``work`` must not call `parallel_for`: all threads might wait for each other.

    Raises:
        Exception: that of the first failed call; parts that have not started are skipped.
    """
    waiting, lock = list(parts)[::-1], Lock()

    def take() -> None:
        try:
            while part := _next(waiting, lock):
                work(*part)
        finally:
            # After an error no thread must start another part; otherwise the list is empty.
            with lock:
                waiting.clear()

    allowed = torch.get_num_threads() - 1
    helpers = min(allowed, len(waiting) - 1)
    running = [_pool(allowed, os.getpid()).submit(take) for _ in range(helpers)]
    try:
        take()
    finally:
        # A helper still queued, because another call occupies the pool, has nothing left to do.
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
    """Threads that live as long as the process; a forked process starts new ones."""
    del process
    return ThreadPoolExecutor(threads, thread_name_prefix="diff4splat-kernels")


def ranges(count: int, size: int) -> list[tuple[int, int]]:
    """(first, last + 1) of consecutive pieces of at most ``size``."""
    return [(first, min(first + size, count)) for first in range(0, count, size)]
