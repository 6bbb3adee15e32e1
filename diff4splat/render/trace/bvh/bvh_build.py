"""Construction of a `Bvh`."""

from collections.abc import Sequence

import numpy as np
import torch

from diff4splat.errors import InputError
from diff4splat.render.trace.bvh.bvh import Bvh, TimedGaussians
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.support import unsupported_reason


@torch.no_grad()
def build_bvh(states: Sequence[TimedGaussians], settings: TraceSettings) -> Bvh:
    """One hierarchy for several states of a scene, by the boxes around all of them.

    One state in the middle of an exposure is as good as all, unless they differ much. ``settings``
    are those of the tracing; others give the same results and may be slower.

    Raises:
        InputError: there is no state, or they differ in the number of Gaussians.
    """
    counts = {len(state.gaussians) for state in states}
    if len(counts) != 1:
        raise InputError(
            f"build_bvh: expected states of one scene, got {sorted(counts) or 'none'} Gaussians"
        )
    (count,) = counts
    if any(unsupported_reason(state.gaussians) is not None for state in states):
        return Bvh(order=np.empty(0, np.int32), count=count)
    # Numba is loaded with the first hierarchy, not with the library.
    from diff4splat.render.trace.bvh.leaf_order import leaf_order

    return Bvh(order=leaf_order(states, settings), count=count)
