"""What every solver asks of its velocity and its start."""

from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.flow.sampler_types import JumpingVelocity, VelocityFn


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
    if isinstance(velocity, JumpingVelocity):
        return _CheckedJumping(velocity)
    return lambda state, level: _as_state(velocity(state, level), state)


@dataclass(frozen=True, slots=True)
class _CheckedJumping:
    velocity: JumpingVelocity

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.velocity.jumps

    @property
    def strong(self) -> bool:
        return self.velocity.strong

    def __call__(self, state: Tensor, level: float) -> Tensor:
        return _as_state(self.velocity(state, level), state)

    def sides(self, state: Tensor, level: float) -> tuple[Tensor, Tensor]:
        above, below = self.velocity.sides(state, level)
        return _as_state(above, state), _as_state(below, state)


def _as_state(answer: Tensor, state: Tensor) -> Tensor:
    if answer.shape != state.shape:
        want, got = tuple(state.shape), tuple(answer.shape)
        raise ShapeError(f"velocity: expected the state's shape {want}, got {got}")
    return answer.to(state.dtype)
