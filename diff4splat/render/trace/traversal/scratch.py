"""Memory that one thread reuses from packet to packet, and grows when a packet needs more."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES
from diff4splat.kernels.simd_memory import aligned_floats
from diff4splat.render.trace.tables import Floats, Integers
from diff4splat.render.trace.traversal.frame import LAST, PACKET, PLANES, ROUNDING

CHUNK = 32
"""Candidates that are intersected before rays settle hits that cannot change any more."""
SHAPE_COLUMNS = 24
BUCKETS = 256
_STACK = 16 * 12


class Scratch(NamedTuple):
    """Axes: ``c`` candidates at most, ``h`` hits of all rays at most."""

    stack: NDArray[np.int64]
    planes: Floats
    rows: NDArray[np.int64]
    numbers: Floats
    """The rays of the packet in the axes of its frame."""
    lane_depths: Floats
    lane_depth_bits: NDArray[np.uint32]
    lane_distances: Floats
    lane_alphas: Floats
    keys: NDArray[np.uint64]
    spare_keys: NDArray[np.uint64]
    starts: NDArray[np.int32]
    unsorted: Integers
    """Candidates in the order of the tree (c)."""
    members: Integers
    """Candidates in the order of intersection (c)."""
    depths: Floats
    """Sort keys (c): the least z of a candidate is at least this over `candidates.ORDER_SLACK`."""
    depth_bits: NDArray[np.uint32]
    shapes: Floats
    """Candidates of a chunk in the axes of the frame."""
    distances: Floats
    """τ of the hits, nearest first (h); rays of a packet have equal parts of the room."""
    alphas: Floats
    ranks: Integers
    """Which candidates they are, by their place in ``members``."""
    counts: NDArray[np.int64]
    """Hits per ray."""
    settled: NDArray[np.int64]
    """How many of them, the first ones, can have no others before them any more."""
    soonest: Floats
    """The least τ of the others."""
    light: NDArray[np.float64]
    """Transmittance after the settled hits."""


@inlined
def make_scratch(candidates, hits):
    """Room for so many candidates and hits of a packet."""
    lane_depths, depths = aligned_floats(LANES), np.empty(candidates, np.float32)
    return Scratch(
        np.empty(_STACK, np.int64),
        np.empty(ROUNDING + 1, np.float32),
        np.empty(3 * PLANES, np.int64),
        aligned_floats(LAST),
        lane_depths,
        lane_depths.view(np.uint32),
        aligned_floats(LANES),
        aligned_floats(LANES),
        np.empty(candidates, np.uint64),
        np.empty(candidates, np.uint64),
        np.empty(BUCKETS, np.int32),
        np.empty(candidates, np.int32),
        np.empty(candidates, np.int32),
        depths,
        depths.view(np.uint32),
        np.empty(CHUNK * SHAPE_COLUMNS, np.float32),
        np.empty(hits, np.float32),
        np.empty(hits, np.float32),
        np.empty(hits, np.int32),
        np.zeros(PACKET, np.int64),
        np.zeros(PACKET, np.int64),
        np.zeros(PACKET, np.float32),
        np.zeros(PACKET, np.float64),
    )
