"""How fast this machine is: a fraction of a second of arithmetic and of memory traffic.

Processor time is measured, not time by the clock, so that other programs disturb little.
"""

import os
import platform
import time
from collections.abc import Callable

import numpy as np

from diff4splat.errors import ConfigError

ROUNDS = 5
MOST_APART = 8.0
"""Times as fast or slow: beyond, one number says little about another machine."""
_SIDE, _PRODUCTS = 192, 12
_NUMBERS, _PASSES = 1 << 20, 6


def measure_speed_s(clock: Callable[[], float] = time.thread_time) -> float:
    """Processor seconds of one round, the fastest of several: geometric mean of both parts."""
    random = np.random.default_rng(0)
    matrix = random.random((_SIDE, _SIDE), np.float32)
    long = random.random(_NUMBERS, np.float32)
    spare = np.zeros_like(long)
    arithmetic = min(_timed(lambda: _multiply(matrix), clock) for _ in range(ROUNDS))
    memory = min(_timed(lambda: _stream(long, spare), clock) for _ in range(ROUNDS))
    return (max(arithmetic, 1e-6) * max(memory, 1e-6)) ** 0.5


def machine_name() -> str:
    """System, kind of processor and number of cores."""
    return f"{platform.system()} {platform.machine()}, {os.cpu_count() or 1} cores"


def is_comparable(speed: float) -> bool:
    """Whether times can be scaled to a machine that is ``speed`` times as slow."""
    return 1 / MOST_APART <= speed <= MOST_APART


def require_comparable(speed: float, machine: str) -> float:
    """``speed``, how many times as slow this machine is as ``machine``, if times can be scaled.

    Raises:
        ConfigError: the machines are too different.
    """
    if not is_comparable(speed):
        raise ConfigError(
            f"calibration: expected a machine at most {MOST_APART:g} times as fast or slow as "
            f"{machine}, got one that takes {speed:.2g} times as long; diff4splat report calibrate "
            "measures this one"
        )
    return speed


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


def _stream(numbers: np.ndarray, spare: np.ndarray) -> None:
    """Between two arrays that exist.

    Whether new ones cost page faults differs between processes by what they did before: four times
    the seconds.
    """
    for _ in range(_PASSES):
        np.multiply(numbers, 0.5, out=spare)
        np.add(spare, 0.25, out=numbers)
