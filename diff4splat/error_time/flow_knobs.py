"""Knobs of the sampling loop, measured on a flow whose velocity is known exactly.

The field is a mixture of eight Gaussians in 48 dimensions with standard deviations from 0.005 to
0.5: thin in some directions, like latents of images, so that it is stiff near level 0. The error
is the median over 192 trajectories of |end - end of the reference| / |end of the reference|; the
mean would be set by the few trajectories that end at another component. Seconds are those of the
toy field; what carries over to a network is the number of calls, which labels the points.
"""

from dataclasses import dataclass, replace
from functools import cache

import torch
from torch import Tensor

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, Guidance, guided
from diff4splat.flow.levels import Schedule, make_levels
from diff4splat.flow.samplers import SAMPLERS, VelocityFn, find_sampler, integrate

TRAJECTORIES = 192
CALLS = (8, 16, 32, 64)
GUIDANCE_WEIGHT = 6.0
_ERROR_UNIT = "median relative end-point error"


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplerSetting:
    """A sampler and the levels it visits."""

    sampler: str
    steps: int
    schedule: Schedule = "log_snr"
    shift: float = 1.0

    @property
    def levels(self) -> tuple[float, ...]:
        """From 1 to 0."""
        return make_levels(self.schedule, self.steps, self.shift)

    @property
    def calls(self) -> int:
        """Network evaluations of one run."""
        return find_sampler(self.sampler).calls(self.levels)

    @property
    def schedule_name(self) -> str:
        """Schedule and shift in one word."""
        return self.schedule if self.shift == 1 else f"{self.schedule} shift {self.shift:g}"

    def __str__(self) -> str:
        return f"{self.sampler} {self.schedule_name} {self.steps}"


DEFAULT = SamplerSetting(sampler="multistep2", steps=16)
REFERENCE = SamplerSetting(sampler="midpoint", steps=2000, schedule="uniform")
"""Agrees with twice as many steps, and with another sampler, to about 1e-6."""


def sampler_knob() -> ApproximationSetting:
    """Which sampler, at how many network calls, on the log-SNR schedule."""
    return _compare_samplers("sampler", "solving the sampling equation in few steps", Guidance())


def guided_sampler_knob() -> ApproximationSetting:
    """The same under strong guidance, which makes the flow stiffer."""
    summary = f"solving the sampling equation with guidance {GUIDANCE_WEIGHT:g} in few steps"
    return _compare_samplers("sampler-guided", summary, Guidance(weight=GUIDANCE_WEIGHT))


def levels_knob() -> ApproximationSetting:
    """Which noise levels to visit, with the default sampler."""
    schedules = (("log_snr", 1.0), ("uniform", 1.0), ("uniform", 3.0), ("uniform", 5.0))
    settings = tuple(
        SamplerSetting(sampler=DEFAULT.sampler, steps=calls, schedule=schedule, shift=shift)
        for schedule, shift in schedules
        for calls in CALLS
    )
    return ApproximationSetting(
        name="levels",
        summary="spacing of the noise levels between 1 and 0",
        error_unit=_ERROR_UNIT,
        settings=settings,
        default=DEFAULT,
        reference=REFERENCE,
        run=lambda setting: _sample(setting, _field(Guidance())),
        error=median_relative_error,
        series=lambda setting: setting.schedule_name,
        label=lambda setting: str(setting.calls),
        label_meaning="network calls",
    )


def guidance_knob() -> ApproximationSetting:
    """At which noise levels to evaluate the unconditional branch."""
    intervals = ((0.0, 1.0), (0.2, 1.0), (0.0, 0.9), (0.1, 0.9), (0.2, 0.9), (0.2, 0.8), (0.4, 0.7))
    settings = tuple(
        Guidance(weight=GUIDANCE_WEIGHT, low=low, high=high) for low, high in intervals
    )
    return ApproximationSetting(
        name="guidance-interval",
        summary=f"guidance (weight {GUIDANCE_WEIGHT:g}) only inside an interval of noise levels",
        error_unit=_ERROR_UNIT,
        settings=settings,
        default=replace(DEFAULT_GUIDANCE, weight=GUIDANCE_WEIGHT),
        reference=settings[0],
        run=lambda guidance: _sample(DEFAULT, _field(guidance)),
        error=median_relative_error,
        label=lambda guidance: f"[{guidance.low:g}, {guidance.high:g}]",
        label_meaning="noise levels with guidance",
    )


def median_relative_error(result: Tensor, reference: Tensor) -> float:
    """Median over trajectories of the distance between end points, relative to the reference's."""
    return float(((result - reference).norm(dim=-1) / reference.norm(dim=-1)).median())


def _compare_samplers(name: str, summary: str, guidance: Guidance) -> ApproximationSetting:
    settings = tuple(
        SamplerSetting(sampler=sampler.name, steps=calls // sampler.calls_per_step)
        for sampler in SAMPLERS.values()
        for calls in CALLS
    )
    return ApproximationSetting(
        name=name,
        summary=summary,
        error_unit=_ERROR_UNIT,
        settings=settings,
        default=DEFAULT,
        reference=REFERENCE,
        run=lambda setting: _sample(setting, _field(guidance)),
        error=median_relative_error,
        series=lambda setting: setting.sampler,
        label=lambda setting: str(setting.calls),
        label_meaning="network calls",
    )


def _sample(setting: SamplerSetting, velocity: VelocityFn) -> Tensor:
    generator = torch.Generator().manual_seed(7)
    start = torch.randn(TRAJECTORIES, 48, generator=generator, dtype=torch.float64)
    return integrate(find_sampler(setting.sampler), velocity, start, setting.levels)


@cache
def _mixture() -> GaussianMixture:
    return random_mixture(seed=1)


def _field(guidance: Guidance) -> VelocityFn:
    """Guided towards a condition that prefers two of the eight components; weight 1 is unguided."""
    mixture = _mixture()
    if guidance.weight == 1:
        return mixture.velocity
    preferred = torch.tensor([2.0] * 2 + [-2.0] * 6, dtype=torch.float64)
    return guided(mixture.with_weights(preferred).velocity, mixture.velocity, guidance)
