"""Which process of a test run compiles which kernels: each group once, before the first test.

Two processes that come to need the same kernels would both compile them.
"""

import gc
import os

from diff4splat.data_prep.synthetic.renderer.jit import GROUP as WORLDS
from diff4splat.kernels.group import KernelGroup
from diff4splat.render.raster.jit import GROUP as RASTERIZER
from diff4splat.render.trace.jit import GROUP as TRACER

GROUPS = (TRACER, WORLDS, RASTERIZER)
"""The slowest first."""


def compile_share() -> None:
    """Compile the groups of this process, if it is one of several."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None:
        return
    number, count = int(worker.removeprefix("gw")), int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    # The compiler makes garbage by the million, and none of it is worth a search.
    gc.disable()
    # A process that takes the place of a crashed one has a number beyond the count.
    for group in shares(count)[number % count]:
        if not group.is_ready():
            group.precompile()
    gc.enable()


def shares(count: int) -> list[list[KernelGroup]]:
    """The groups of each of ``count`` processes, about as long for all."""
    found: list[list[KernelGroup]] = [[] for _ in range(count)]
    for group in GROUPS:
        least = min(found, key=lambda share: sum(one.compile_s for one in share))
        least.append(group)
    return found
