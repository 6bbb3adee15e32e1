"""What a user may choose about one generation; everything else is in the model's configuration."""

from dataclasses import dataclass

from diff4splat.errors import ConfigError
from diff4splat.flow.adaptive import StepControl
from diff4splat.flow.fitted import FittedSteps
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, UNGUIDED, Guidance
from diff4splat.flow.levels import (
    Schedule,
    make_levels,
    piecewise_levels,
    require_levels,
    shift_levels,
)
from diff4splat.flow.solve import ADAPTIVE, FITTED, SolverPath, require_solver
from diff4splat.generation.fitted_steps import find_steps
from diff4splat.models.config.model import Fill
from diff4splat.models.networks import PARTS
from diff4splat.scene.edit import MIN_OPACITY

MAX_STEPS = 1000
MAX_KEY_TIMES, MAX_FILL_STRIDE = 1000, 8
LAST_LEVEL = 0.02
"""Where eight steps end that are even in log signal-to-noise ratio (docs/results/samplers.md)."""
ADAPTIVE_STEPS = 16
"""Typical number at the default tolerance."""
PIECEWISE = "piecewise2"
"""The sampler whose levels follow the guidance interval."""
ENOUGH_STEPS = 6
"""With fewer, evenly spaced in log signal-to-noise ratio throws guided samples off their course."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """Sampling of the motion prior; defaults as measured in docs/results/generation.md."""

    steps: int = 1
    """One gives the mean of what the prompt allows; more draw a sample per seed."""
    shift: float = 16.0
    """As in its training: where objects are is learnt at noisy levels."""
    guidance: Guidance = UNGUIDED
    threshold: float = 0.2
    """A pixel moves if it is more probable than this, or among the most probable (ADR 22)."""

    def __post_init__(self) -> None:
        if not 1 <= self.steps <= MAX_STEPS:
            raise ConfigError(f"--steps: expected 1 to {MAX_STEPS}, got {self.steps}")
        require_levels(self.levels)
        if not 0 <= self.threshold <= 1:
            raise ConfigError(f"motion threshold: expected 0 to 1, got {self.threshold:g}")

    @property
    def levels(self) -> tuple[float, ...]:
        """Noise levels that the sampler visits."""
        return make_levels("uniform", self.steps, self.shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class GenerationSettings:
    """Sampling, guidance, what fills hidden regions, and what to leave out of the scene.

    ``steps``, ``sampler``, ``schedule``, ``shift`` and ``guidance`` are those of the video model.
    """

    steps: int = 4
    sampler: str = "multistep2"
    schedule: Schedule | None = None
    """None takes the better one for the number of steps (docs/results/samplers.md)."""
    shift: float = 1.0
    """Above 1 spends more steps on noisy levels (Wan 2.1: 3)."""
    last_level: float = LAST_LEVEL
    """More steps end no nearer to clean latents: what the network predicts there has no limit."""
    latent_tolerance: float = 0.1
    """Error per step of the sampler ``adaptive``, in units of the latent; it sets the steps."""
    guidance: Guidance | None = None
    """Used only when there is a prompt; None takes the model's default."""
    negative_prompt: str = ""
    """What guidance of the video model leads away from."""
    motion: MotionSettings = MotionSettings()
    """The same for the motion prior."""
    fill: Fill | None = None
    """What shows where the image hides: extended layers (none), or the video model; None takes the
    model's default."""
    still: bool = False
    """Nothing moves, whatever the prompt says."""
    min_opacity: float = MIN_OPACITY
    static_threshold_px: float = 0.05
    """Gaussians that never move by more than this many pixels of the input view are static."""
    color_matching_steps: int = 7
    """Corrections of the image's colours against the rendered input view; 0 switches off."""

    photometric_steps: int = 15
    """Gradient steps on the frames of a true video after its reconstruction; 0 switches off."""

    subpixel_infill: bool = True
    """Gaussians between the image's pixels; without them there are a quarter as many, twice as
    wide."""
    key_times: int | None = None
    """Times at which the scene keeps the image's motion; None is one per frame of the model."""
    fill_stride: int = 1
    """The video fill has a Gaussian for every n-th cell along both axes, n times as wide."""
    extended_layers: bool = True
    """False shows the image's own layers alone, and nothing where it hides what is there."""
    without: tuple[str, ...] = ()
    """Networks that stay out although the request needs them: ablations."""

    def __post_init__(self) -> None:
        if not 1 <= self.steps <= MAX_STEPS:
            raise ConfigError(f"--steps: expected 1 to {MAX_STEPS}, got {self.steps}")
        if self.fill not in (None, "none", "video"):
            raise ConfigError(f"--fill: expected none or video, got {self.fill!r}")
        require_solver(self.sampler)
        StepControl(tolerance=self.latent_tolerance, last_level=self.last_level)
        require_levels(self.levels)
        if not 0 <= self.color_matching_steps <= 100:
            raise ConfigError(
                f"color_matching_steps: expected 0 to 100, got {self.color_matching_steps}"
            )
        if not 0 <= self.photometric_steps <= 1000:
            raise ConfigError(
                f"--photometric-steps: expected 0 to 1000, got {self.photometric_steps}"
            )
        if self.key_times is not None and not 2 <= self.key_times <= MAX_KEY_TIMES:
            raise ConfigError(f"key_times: expected 2 to {MAX_KEY_TIMES}, got {self.key_times}")
        if not 1 <= self.fill_stride <= MAX_FILL_STRIDE:
            raise ConfigError(
                f"fill_stride: expected 1 to {MAX_FILL_STRIDE}, got {self.fill_stride}"
            )
        unknown = sorted(set(self.without) - set(PARTS))
        if unknown:
            raise ConfigError(
                f"without: expected names of networks ({', '.join(PARTS)}), got {unknown[0]!r}"
            )
        if not 0 <= self.min_opacity <= 1:
            raise ConfigError(f"--min-opacity: expected 0 to 1, got {self.min_opacity:g}")
        if not 0 <= self.static_threshold_px < 100:
            raise ConfigError(
                f"static_threshold_px: expected 0 to 100, got {self.static_threshold_px:g}"
            )

    @property
    def levels(self) -> tuple[float, ...]:
        """Noise levels that the sampler visits."""
        if self.fitted is not None:
            return (*self.fitted.levels, 0.0)
        enough = self.steps >= ENOUGH_STEPS
        if self.sampler == PIECEWISE and self.schedule is None and enough:
            jumps = (self.guidance or DEFAULT_GUIDANCE).jumps
            return shift_levels(piecewise_levels(self.steps, jumps, self.last_level), self.shift)
        measured: Schedule = "log_snr" if enough else "uniform"
        return make_levels(self.schedule or measured, self.steps, self.shift, self.last_level)

    @property
    def fitted(self) -> FittedSteps | None:
        """Weights of the sampler ``fitted``."""
        return find_steps(self.steps) if self.sampler == FITTED else None

    @property
    def expected_steps(self) -> int:
        """Of the video model, for progress; an adaptive step size decides while it runs."""
        return ADAPTIVE_STEPS if self.sampler == ADAPTIVE else self.steps

    @property
    def solver_path(self) -> SolverPath:
        """Of the video model's solver."""
        return SolverPath(levels=self.levels, control=self.step_control, fitted=self.fitted)

    @property
    def step_control(self) -> StepControl:
        """Of the sampler ``adaptive``; the worst latent frame counts."""
        return StepControl(
            tolerance=self.latent_tolerance, last_level=self.last_level, kept_axes=(0, 2)
        )


def why_unguided(guidance: Guidance) -> str:
    """Why a prompted generation leaves some unconditional passes out."""
    if guidance.weight == 1:
        return "a guidance weight of 1 needs no other pass"
    return "outside the guidance interval"


def require_seed(seed: int) -> int:
    """Return ``seed`` when a random generator takes it.

    Raises:
        ConfigError: negative, or 2^63 and above.
    """
    if not 0 <= seed < 2**63:
        raise ConfigError(f"--seed: expected 0 to 2^63 - 1, got {seed}")
    return seed
