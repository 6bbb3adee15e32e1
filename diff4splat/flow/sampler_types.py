"""What a sampler of the flow is: velocity, one step, memory of earlier steps, order and cost.

Axes: ``b`` batch, ``*d`` everything else.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from torch import Tensor

VelocityFn = Callable[[Tensor, float], Tensor]
"""(noisy state, level) to velocity in the same shape; casts its input as its network needs."""


@runtime_checkable
class JumpingVelocity(Protocol):
    """A velocity that is not continuous in the level everywhere."""

    @property
    def jumps(self) -> tuple[float, ...]:
        """Levels at which it jumps."""

    @property
    def strong(self) -> bool:
        """Whether last changes may mislead at few steps: strong guidance."""

    def __call__(self, state: Tensor, level: float) -> Tensor:
        """The velocity; at a jump, that of the side which guides."""

    def sides(self, state: Tensor, level: float) -> tuple[Tensor, Tensor]:
        """At a jump: just above the level, and just below it, for one evaluation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """What a multistep method keeps of an earlier step."""

    state: Tensor
    level: float
    clean: Tensor
    """Prediction of the data from ``state``."""
    before: "Memory | None" = None
    """The step before that, for methods that keep two."""


StepFn = Callable[
    [VelocityFn, Tensor, tuple[float, float], Memory | None], tuple[Tensor, Memory | None]
]
"""(velocity, state, (level, next level), memory) to the next state and memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampler:
    """One step rule with the order of accuracy and the cost it must show in tests."""

    name: str
    order: int
    calls_per_step: int
    calls_into_zero: int
    """Calls of a step that ends at level 0."""
    step: StepFn

    def calls(self, levels: Sequence[float]) -> int:
        """Network evaluations along ``levels``."""
        last = self.calls_into_zero if levels[-1] == 0 else self.calls_per_step
        return self.calls_per_step * (len(levels) - 2) + last
