"""Classifier-free guidance that evaluates only the branches that matter.

    velocity = unconditional + weight · (conditional - unconditional)

(Ho & Salimans, arXiv 2207.12598, with weight = 1 + their w), active only for levels in
[low, high]: guidance at high noise hurts and at low noise does nothing (Kynkäänniemi et al.,
arXiv 2404.07724). Outside the interval, and at weight 1, the conditional branch alone is the
answer; at weight 0, or without a condition, the unconditional one.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.flow.samplers import VelocityFn


@dataclass(frozen=True, slots=True, kw_only=True)
class Guidance:
    """How strongly to guide, and at which noise levels."""

    weight: float = 1.0
    """1 follows the condition without guidance, 0 ignores it."""
    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.weight) and self.weight >= 0):
            raise ConfigError(f"guidance weight: expected 0 or above, got {self.weight}")
        if not 0 <= self.low <= self.high <= 1:
            raise ConfigError(
                f"guidance interval: expected 0 <= low <= high <= 1, got [{self.low}, {self.high}]"
            )

    def __str__(self) -> str:
        return f"{self.weight:g} in [{self.low:g}, {self.high:g}]"

    def active(self, level: float) -> bool:
        """Whether both branches are mixed at ``level``."""
        return self.weight != 1 and self.low <= level <= self.high

    @property
    def jumps(self) -> tuple[float, ...]:
        """Levels where guidance begins or ends on the way from noise to data."""
        ends = () if self.weight == 1 else dict.fromkeys((self.high, self.low))
        return tuple(end for end in ends if 0 < end < 1)


STRONG = 10.0
UNGUIDED = Guidance(weight=1.0)
"""The condition unchanged."""
DEFAULT_GUIDANCE = Guidance(weight=5.0, low=0.2, high=1.0)
"""What a prompted generation uses by default."""


@dataclass(slots=True, kw_only=True)
class CallCount:
    """Network evaluations of a guided run, against always evaluating both branches."""

    conditional: int = 0
    unconditional: int = 0
    total: int = 0
    """Velocities asked for."""

    @property
    def saved(self) -> int:
        """Evaluations left out."""
        return 2 * self.total - self.conditional - self.unconditional


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidedVelocity:
    """A ``JumpingVelocity`` of two branches; each is asked only where its answer counts."""

    conditional: VelocityFn | None
    unconditional: VelocityFn | None
    guidance: Guidance
    count: CallCount

    @property
    def jumps(self) -> tuple[float, ...]:
        """Ends of the interval; none without a condition."""
        return () if self.conditional is None else self.guidance.jumps

    @property
    def strong(self) -> bool:
        """From ``STRONG`` on, few steps of higher order end further off than Euler's."""
        return self.conditional is not None and self.guidance.weight >= STRONG

    def __call__(self, state: Tensor, level: float) -> Tensor:
        """The guided velocity inside the interval, its ends included."""
        active = self.guidance.active(level)
        ask_unconditional = active or self.conditional is None
        ask_conditional = self.conditional is not None and not (
            active and self.guidance.weight == 0
        )
        self._counted(ask_conditional, ask_unconditional)
        if ask_conditional and ask_unconditional:
            return mix(
                self.unconditional(state, level),
                self.conditional(state, level),
                self.guidance.weight,
            )
        return (self.conditional if ask_conditional else self.unconditional)(state, level)

    def sides(self, state: Tensor, level: float) -> tuple[Tensor, Tensor]:
        """At an end of the interval: one guided evaluation, whose conditional branch is outside."""
        self._counted(True, True)
        outside = self.conditional(state, level)
        inside = mix(self.unconditional(state, level), outside, self.guidance.weight)
        if self.guidance.low == self.guidance.high:
            return outside, outside
        return (outside, inside) if level == self.guidance.high else (inside, outside)

    def _counted(self, conditional: bool, unconditional: bool) -> None:
        self.count.total += 1
        self.count.conditional += conditional
        self.count.unconditional += unconditional


def guided(
    conditional: VelocityFn | None,
    unconditional: VelocityFn | None,
    guidance: Guidance,
    count: CallCount | None = None,
) -> GuidedVelocity:
    """One velocity from the two branches; either may be absent where it is never needed.

    Raises:
        ConfigError: a branch is missing that ``guidance`` needs.
    """
    _require_branches(conditional, unconditional, guidance)
    return GuidedVelocity(
        conditional=conditional,
        unconditional=unconditional,
        guidance=guidance,
        count=CallCount() if count is None else count,
    )


def mix(
    unconditional: Float[Tensor, "*b"], conditional: Float[Tensor, "*b"], weight: float
) -> Float[Tensor, "*b"]:
    """Extrapolate from the unconditional velocity through the conditional one.

    At least float32: the difference of two close half-precision numbers, times 30, is mostly noise.
    """
    dtype = torch.promote_types(unconditional.dtype, torch.float32)
    start = unconditional.to(dtype)
    return start + weight * (conditional.to(dtype) - start)


def _require_branches(
    conditional: VelocityFn | None, unconditional: VelocityFn | None, guidance: Guidance
) -> None:
    if conditional is None and unconditional is None:
        raise ConfigError("guidance: expected at least one branch, got none")
    if unconditional is None and guidance.weight != 1:
        raise ConfigError(
            f"guidance weight: expected 1 without an unconditional branch, got {guidance.weight}"
        )
