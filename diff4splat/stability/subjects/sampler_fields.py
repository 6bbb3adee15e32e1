"""Exact velocity fields of thin data under strong guidance, and where their trajectories end.

Axes: ``w`` guidance weights, ``b`` trajectories, ``d`` dimensions. The data are four Gaussians of
one standard deviation in all directions; the condition prefers one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.guidance import Guidance, guided
from diff4splat.flow.levels import make_levels
from diff4splat.flow.samplers import VelocityFn, find_sampler, integrate
from diff4splat.generation.settings import GenerationSettings

TRAJECTORIES, COMPONENTS, DIMENSIONS = 48, 4, 16
REFERENCE_STEPS = 500
"""Of ``midpoint``, evenly spaced in log signal-to-noise ratio. Four times as many change the end
points by 1e-4 or less, for every deviation and guidance of the report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThinData:
    """A mixture, and the same under a condition."""

    plain: GaussianMixture
    preferred: GaussianMixture

    def velocity(self, weight: float) -> VelocityFn:
        """Guided at all levels."""
        return guided(self.preferred.velocity, self.plain.velocity, Guidance(weight=weight))


@cache
def thin_data(deviation: float) -> ThinData:
    """Data whose standard deviation is ``deviation``."""
    mixture = random_mixture(1, COMPONENTS, DIMENSIONS, (deviation, deviation))
    log_weights = torch.tensor([2.0] + [-2.0] * (COMPONENTS - 1), dtype=torch.float64)
    return ThinData(plain=mixture, preferred=mixture.with_weights(log_weights))


def initial_noise() -> Float[Tensor, "b d"]:
    """The same for every sampler."""
    generator = torch.Generator().manual_seed(7)
    return torch.randn(TRAJECTORIES, DIMENSIONS, generator=generator, dtype=torch.float64)


def end_points(sampler: str, steps: int, deviation: float, weight: float) -> Float[Tensor, "b d"]:
    """Where a sampler ends, on the levels that generation would choose."""
    levels = GenerationSettings(steps=steps, sampler=sampler).levels
    velocity = thin_data(deviation).velocity(weight)
    return integrate(find_sampler(sampler), velocity, initial_noise(), levels)


@cache
def exact_end_points(deviation: float, weights: tuple[float, ...]) -> Float[Tensor, "w b d"]:
    """The converged ones, for all guidance weights at once."""
    data = thin_data(deviation)
    weight = torch.tensor(weights, dtype=torch.float64).repeat_interleave(TRAJECTORIES)[:, None]

    def velocity(state: Tensor, level: float) -> Tensor:
        plain, preferred = (part.velocity(state, level) for part in (data.plain, data.preferred))
        return plain + weight * (preferred - plain)

    start = initial_noise().repeat(len(weights), 1)
    levels = make_levels("log_snr", REFERENCE_STEPS)
    ends = integrate(find_sampler("midpoint"), velocity, start, levels)
    return ends.unflatten(0, (len(weights), TRAJECTORIES))


def end_point_errors(
    ends: Sequence[Float[Tensor, "b d"]], exact: Sequence[Float[Tensor, "b d"]]
) -> Float[Tensor, "w b"]:
    """Distance to the exact end point over its length; infinite where it is not finite."""
    pairs = zip(ends, exact, strict=True)
    errors = torch.stack([(end - want).norm(dim=-1) / want.norm(dim=-1) for end, want in pairs])
    return torch.nan_to_num(errors, nan=torch.inf)
