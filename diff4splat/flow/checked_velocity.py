"""What every solver asks of its velocity and its start."""

import torch
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.flow.sampler_types import VelocityFn


def solver_state(start: Tensor) -> Tensor:
    """``start`` in at least float32: against a bfloat16 state small steps vanish.

    Raises:
        ShapeError: ``start`` is not floating point.
    """
    if not start.is_floating_point():
        raise ShapeError(f"start: expected floating-point numbers, got {start.dtype}")
    return start.to(torch.promote_types(start.dtype, torch.float32))


def checked(velocity: VelocityFn) -> VelocityFn:
    """``velocity`` in the state's dtype; an answer that would broadcast is refused."""

    def call(state: Tensor, level: float) -> Tensor:
        answer = velocity(state, level)
        if answer.shape != state.shape:
            want, got = tuple(state.shape), tuple(answer.shape)
            raise ShapeError(f"velocity: expected the state's shape {want}, got {got}")
        return answer.to(state.dtype)

    return call
