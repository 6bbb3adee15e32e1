"""Who are neighbours among Gaussians in several states: the compiled side of `hierarchy`."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from diff4splat.render.trace.boxes import Boxes, boxes_between, nothing, united
from diff4splat.render.trace.forward import make_primitives, make_rules
from diff4splat.render.trace.hierarchy import State
from diff4splat.render.trace.jit import GROUP
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.support import usable
from diff4splat.render.trace.tables import Cloud, Floats, Integers, Motion
from diff4splat.render.trace.tree import build


def neighbours(states: Sequence[State], settings: TraceSettings) -> Integers:
    """Indices of all Gaussians that can be seen in any state, by the boxes around all states."""
    GROUP.ensure_compiled()
    return build(united([_boxes(state, settings) for state in states])).order


def _boxes(state: State, settings: TraceSettings) -> Boxes:
    """Of all Gaussians; nothing where they cannot be seen or drawn."""
    kept, dropped = usable(state.gaussians, state.moving)
    gaussians, moving = state.gaussians, state.moving
    if dropped:
        index = kept.nonzero().squeeze(1)
        gaussians, moving = gaussians.select(index), moving and moving.select(index)
    primitives, reach = make_primitives(
        Cloud(*(_array(getattr(gaussians, name)) for name in Cloud._fields)),
        _motion(moving),
        make_rules(settings, math.inf),
    )
    made = boxes_between(primitives, reach, state.earliest_s, state.latest_s)
    if not dropped:
        return made
    around = nothing(len(kept))
    around.lower[kept.numpy()], around.upper[kept.numpy()] = made
    return around


def _motion(moving: MovingCloud | None) -> Motion:
    if moving is None:
        return Motion(np.empty((0, 3), np.float32), *(np.empty(0, np.float32),) * 2)
    columns = (moving.velocities, moving.time_centers_s, moving.time_deviations_s)
    return Motion(*map(_array, columns))


def _array(tensor: Tensor) -> Floats:
    return tensor.detach().to(device="cpu", dtype=torch.float32).contiguous().numpy()
