"""The order of Gaussians in the leaves of a hierarchy: the compiled part of `bvh_build`."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from diff4splat.render.trace.bvh.boxes import Boxes, empty_boxes, swept_boxes, united
from diff4splat.render.trace.bvh.bvh import TimedGaussians
from diff4splat.render.trace.bvh.tree import build_tree
from diff4splat.render.trace.forward import make_primitives, make_rules
from diff4splat.render.trace.jit import GROUP
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.support import valid_gaussians
from diff4splat.render.trace.tables import Cloud, Floats, Integers, MotionArrays


def leaf_order(states: Sequence[TimedGaussians], settings: TraceSettings) -> Integers:
    """Indices of all Gaussians that are visible in any state, by the boxes around all states."""
    GROUP.ensure_compiled()
    return build_tree(united([_boxes(state, settings) for state in states])).order


def _boxes(state: TimedGaussians, settings: TraceSettings) -> Boxes:
    """Of all Gaussians; empty for those that are invisible or invalid."""
    kept, dropped = valid_gaussians(state.gaussians, state.moving)
    gaussians, moving = state.gaussians, state.moving
    if dropped:
        index = kept.nonzero().squeeze(1)
        gaussians, moving = gaussians.select(index), moving and moving.select(index)
    primitives, reach = make_primitives(
        Cloud(*(_array(getattr(gaussians, name)) for name in Cloud._fields)),
        _motion(moving),
        make_rules(settings, math.inf),
    )
    boxes = swept_boxes(primitives, reach, state.earliest_s, state.latest_s)
    if not dropped:
        return boxes
    padded = empty_boxes(len(kept))
    padded.lower[kept.numpy()], padded.upper[kept.numpy()] = boxes
    return padded


def _motion(moving: MovingCloud | None) -> MotionArrays:
    if moving is None:
        return MotionArrays(np.empty((0, 3), np.float32), *(np.empty(0, np.float32),) * 2)
    columns = (moving.velocities, moving.time_centers_s, moving.time_deviations_s)
    return MotionArrays(*map(_array, columns))


def _array(tensor: Tensor) -> Floats:
    return tensor.detach().to(device="cpu", dtype=torch.float32).contiguous().numpy()
