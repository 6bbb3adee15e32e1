"""How fast this machine is: a fraction of a second of arithmetic and of memory traffic.

Processor time is measured, not time by the clock, so that other programs disturb little.
"""

import time
from collections.abc import Callable

import numpy as np

ROUNDS = 5
_SIDE, _PRODUCTS = 192, 12
_NUMBERS, _PASSES = 1 << 20, 6


def measure_speed_s(clock: Callable[[], float] = time.thread_time) -> float:
    """Processor seconds of one round, the fastest of several: geometric mean of both parts."""
    random = np.random.default_rng(0)
    matrix = random.random((_SIDE, _SIDE), np.float32)
    long = random.random(_NUMBERS, np.float32)
    arithmetic = min(_timed(lambda: _multiply(matrix), clock) for _ in range(ROUNDS))
    memory = min(_timed(lambda: _stream(long), clock) for _ in range(ROUNDS))
    return (max(arithmetic, 1e-6) * max(memory, 1e-6)) ** 0.5


def _timed(work: Callable[[], None], clock: Callable[[], float]) -> float:
    began = clock()
    work()
    return clock() - began


def _multiply(matrix: np.ndarray) -> None:
    product = matrix
    for _ in range(_PRODUCTS):
        # einsum computes in this thread alone; a BLAS may use others, whose time is not seen.
        product = np.einsum("ij,jk->ik", matrix, product)
        product *= 1 / _SIDE


def _stream(numbers: np.ndarray) -> None:
    for _ in range(_PASSES):
        numbers = numbers * 0.5 + 0.25
