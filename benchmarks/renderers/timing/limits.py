"""What this machine can do at most, measured, so that times can be read as shares of it.

Arithmetic: fused multiply-adds of float32 in registers (Numba; a matrix product where Numba is
missing, which reaches less). Memory: copying an array larger than any cache, bytes read plus
written. Both with all threads that the comparison uses.
"""

import importlib.util
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from records import Cell, Work

FORWARD_FLOPS_PER_PAIR = 30
"""Blending one pixel with one Gaussian: offset and exponent 8, exp2 by a polynomial 13, alpha and
its decisions 3, weight and light 3, three colours as multiply-adds 6; less what is shared.
Counted from the formula; a kernel's own count may replace it."""
BOTH_FLOPS_PER_PAIR = 110
"""Forward, the same again on the backward pass, and some 50 for the gradients of colour, opacity,
centre and conic."""
_COPY_FLOATS, _LANES, _REPEATS = 64 << 20, 128, 5


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineLimits:
    """Measured limits with a number of threads."""

    threads: int
    flops: float
    """Floating-point operations per second, float32; a multiply-add is two."""
    bytes_per_s: float
    how: str
    """What the arithmetic was measured with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shares:
    """One kind of call of one renderer against the limits."""

    ns_per_pair: float
    flops: float
    """Floating-point operations of blending alone, per second."""
    flops_share: float
    bytes_share: float
    """Least traffic (every parameter read once, every pixel written once) against the copy."""


class LimitsWorker:
    """Measures the limits, in a worker."""

    def measure(self) -> MachineLimits:
        """The limits with the threads of this process."""
        threads = torch.get_num_threads()
        if importlib.util.find_spec("numba") is not None:
            flops, how = _multiply_adds(threads), "fused multiply-adds in registers"
        else:
            flops, how = _matrix_product(), "a matrix product"
        return MachineLimits(threads=threads, flops=flops, bytes_per_s=_copy(), how=how)


def shares(cell: Cell, work: Work, limits: MachineLimits, backward: bool) -> Shares | None:
    """How near a renderer comes to the limits; None where it was not measured."""
    timing = cell.both if backward else cell.forward
    if timing is None or not work.blended_pairs > 0:
        return None
    flops_per_pair = BOTH_FLOPS_PER_PAIR if backward else FORWARD_FLOPS_PER_PAIR
    flops = flops_per_pair * work.blended_pairs / timing.best_s
    # 14 floats per Gaussian of degree 0, three per pixel; gradients are as large as both.
    least_bytes = 4 * (14 * work.gaussians + 3 * work.pixels) * (2 if backward else 1)
    return Shares(
        ns_per_pair=1e9 * timing.best_s / work.blended_pairs,
        flops=flops,
        flops_share=flops / limits.flops,
        bytes_share=least_bytes / timing.best_s / limits.bytes_per_s,
    )


def _best_s(work: Callable[[], object]) -> float:
    times_s = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        work()
        times_s.append(time.perf_counter() - began)
    return min(times_s)


def _copy() -> float:
    source, target = torch.ones(_COPY_FLOATS), torch.ones(_COPY_FLOATS)
    return 8 * _COPY_FLOATS / _best_s(lambda: target.copy_(source))


def _matrix_product() -> float:
    side = 1024
    left, right = torch.ones(side, side), torch.ones(side, side)
    return 2 * side**3 / _best_s(lambda: left @ right)


def _multiply_adds(threads: int) -> float:
    import numba
    import numpy as np

    # "contract" allows the fused instruction and nothing else: full fast-math would fold rounds.
    @numba.njit(parallel=True, fastmath={"contract"})
    def spin(sums: np.ndarray, rounds: int, factor: np.float32, term: np.float32) -> None:
        for thread in numba.prange(sums.shape[0]):
            own = sums[thread]
            for _ in range(rounds):
                for lane in range(_LANES):
                    own[lane] = own[lane] * factor + term

    numbers = np.ones((threads, _LANES), np.float32), np.float32(0.999), np.float32(0.001)
    rounds = 1_000_000

    def run(count: int) -> None:
        spin(numbers[0], count, numbers[1], numbers[2])

    run(1)
    return 2 * _LANES * threads * rounds / _best_s(lambda: run(rounds))
