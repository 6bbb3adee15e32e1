"""What generation approximates, and what it leaves to the user."""

from dataclasses import dataclass, replace

from diff4splat.approximations.declaration import Approximation, UserChoices, set_field
from diff4splat.flow.adaptive import StepControl
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, Guidance
from diff4splat.flow.levels import Schedule
from diff4splat.flow.samplers import find_sampler
from diff4splat.flow.solve import ADAPTIVE, FITTED
from diff4splat.generation.settings import GenerationSettings, MotionSettings

DEFAULTS = GenerationSettings()
WEIGHTS = (1.0, 2.0, 3.5, 5.0, 7.5, 10.0)
INTERVALS = ((0.0, 1.0), (0.2, 1.0), (0.2, 0.9), (0.2, 0.8), (0.4, 0.9), (0.5, 0.5))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """A sampler of the video model with its steps, or with the tolerance that sets them."""

    sampler: str = DEFAULTS.sampler
    steps: int = DEFAULTS.steps
    schedule: Schedule | None = None
    tolerance: float | None = None

    def __str__(self) -> str:
        if self.tolerance is not None:
            return f"{ADAPTIVE} {self.tolerance:g}"
        schedule = f" {self.schedule}" if self.schedule else ""
        return f"{self.sampler}{schedule} {self.steps}"

    @property
    def label(self) -> str:
        """Calls of the network, or the tolerance."""
        if self.tolerance is not None:
            return f"tol {self.tolerance:g}"
        per_step = 1 if self.sampler == FITTED else find_sampler(self.sampler).calls_per_step
        return str(self.steps * per_step)

    def apply(self, settings: GenerationSettings) -> GenerationSettings:
        """The same generation with this sampler."""
        if self.tolerance is not None:
            return replace(settings, sampler=ADAPTIVE, latent_tolerance=self.tolerance)
        chosen = {"sampler": self.sampler, "steps": self.steps, "schedule": self.schedule}
        return replace(settings, **chosen)


REFERENCE = Sampling(sampler="piecewise2", steps=160)
"""80 steps are among the values, so that the report shows how converged it is."""
SAMPLINGS = (
    *(Sampling(sampler="euler", steps=n, schedule="uniform") for n in (8, 50)),
    *(Sampling(sampler=name, steps=4) for name in ("midpoint", "heun", "multistep2")),
    Sampling(sampler="dpmpp2m", steps=12),
    *(
        Sampling(sampler=name, steps=n)
        for name in ("unipc", "multistep2", "piecewise2")
        for n in (8, 12, 16)
    ),
    Sampling(sampler="piecewise2", steps=80),
    *(Sampling(sampler=FITTED, steps=n) for n in (8, 12)),
    *(Sampling(sampler=ADAPTIVE, tolerance=tolerance) for tolerance in (0.3, 0.1)),
)

APPROXIMATIONS = (
    Approximation(
        name="video-sampling",
        subject="video",
        summary="solving the video model's sampling equation in few steps",
        fields=(
            "GenerationSettings.sampler",
            "GenerationSettings.steps",
            "GenerationSettings.schedule",
            "GenerationSettings.latent_tolerance",
            "StepControl.tolerance",
        ),
        values=SAMPLINGS,
        default=Sampling(),
        reference=REFERENCE,
        apply=lambda settings, value: value.apply(settings),
        series=lambda value: value.sampler,
        label=lambda value: value.label,
        label_meaning="evaluations of the velocity, or tolerance",
    ),
    Approximation(
        name="video-shift",
        subject="video",
        summary="shifting the noise levels of the video model",
        fields=("GenerationSettings.shift",),
        values=(0.5, 0.7, 1.0, 2.0, 3.0, 5.0),
        default=1.0,
        reference=REFERENCE,
        apply=lambda settings, value: (
            value.apply(settings) if isinstance(value, Sampling) else replace(settings, shift=value)
        ),
        label_meaning="shift",
    ),
    Approximation(
        name="video-last-level",
        subject="video",
        summary="ending at a level above 0, 32 steps",
        fields=("GenerationSettings.last_level", "StepControl.last_level"),
        values=(0.1, 0.05, DEFAULTS.last_level, 0.01),
        default=DEFAULTS.last_level,
        # Levels even in log signal-to-noise ratio go no lower.
        reference=0.005,
        apply=lambda settings, value: replace(
            settings, sampler="unipc", steps=32, last_level=value
        ),
        label_meaning="last level",
    ),
    Approximation(
        name="video-guidance",
        subject="video",
        summary="guidance of another weight than the default's",
        fields=("GenerationSettings.guidance", "Guidance.weight"),
        values=tuple(replace(DEFAULT_GUIDANCE, weight=weight) for weight in WEIGHTS),
        default=DEFAULT_GUIDANCE,
        reference=DEFAULT_GUIDANCE,
        apply=set_field("guidance"),
        label=lambda value: f"{value.weight:g}",
        label_meaning="weight",
    ),
    Approximation(
        name="video-guidance-interval",
        subject="video",
        summary="guidance at some noise levels only",
        fields=("Guidance.low", "Guidance.high"),
        values=tuple(
            Guidance(weight=DEFAULT_GUIDANCE.weight, low=low, high=high) for low, high in INTERVALS
        ),
        default=DEFAULT_GUIDANCE,
        reference=Guidance(weight=DEFAULT_GUIDANCE.weight),
        apply=set_field("guidance"),
        label=lambda value: f"[{value.low:g}, {value.high:g}]",
        label_meaning="noise levels with guidance",
    ),
    Approximation(
        name="motion-steps",
        subject="motion",
        summary="sampling motion in few steps",
        fields=("MotionSettings.steps",),
        values=(1, 2, 4, 8, 16),
        default=1,
        reference=32,
        apply=set_field("motion.steps"),
        label_meaning="steps",
    ),
    Approximation(
        name="motion-shift",
        subject="motion",
        summary="shifting the noise levels of the motion prior, 8 steps",
        fields=("MotionSettings.shift",),
        values=(1.0, 4.0, 8.0, 16.0, 32.0),
        default=16.0,
        reference=None,
        apply=lambda settings, value: replace(
            settings,
            motion=MotionSettings(steps=32)
            if value is None
            else replace(settings.motion, steps=8, shift=value),
        ),
        label_meaning="shift",
    ),
    Approximation(
        name="color-matching",
        subject="scene",
        summary="matching the colours of the input view in few steps",
        fields=("GenerationSettings.color_matching_steps",),
        values=(0, 1, 3, 5, 7, 12),
        default=7,
        reference=40,
        apply=set_field("color_matching_steps"),
        label_meaning="steps",
    ),
    Approximation(
        name="subpixel-infill",
        subject="scene",
        summary="Gaussians between the pixels of the image",
        fields=("GenerationSettings.subpixel_infill",),
        values=(False, True),
        default=True,
        reference=True,
        apply=set_field("subpixel_infill"),
    ),
    Approximation(
        name="static-threshold",
        subject="scene",
        summary="no key times for what hardly moves",
        fields=("GenerationSettings.static_threshold_px",),
        values=(0.0, 0.05, 0.2, 1.0, 4.0),
        default=0.05,
        reference=0.0,
        apply=set_field("static_threshold_px"),
        label_meaning="pixels of the input view",
    ),
    Approximation(
        name="key-times",
        subject="scene",
        summary="motion at few key times; the motion network has three points in time",
        fields=("GenerationSettings.key_times",),
        values=(2, 3, 4, 9, None),
        default=None,
        reference=65,
        apply=set_field("key_times"),
        label=lambda value: "one per frame" if value is None else str(value),
        label_meaning="key times",
    ),
    Approximation(
        name="fill-stride",
        subject="video-scene",
        summary="every n-th cell of the video fill, n times as wide",
        fields=("GenerationSettings.fill_stride",),
        values=(1, 2, 4),
        default=1,
        reference=1,
        apply=set_field("fill_stride"),
        label_meaning="cells from Gaussian to Gaussian",
    ),
    Approximation(
        name="fill-pruning",
        subject="video-scene",
        summary="dropping Gaussians of the video fill below an opacity",
        fields=("GenerationSettings.min_opacity",),
        values=(0.0, 0.005, 0.02, 0.1, 0.3),
        default=0.005,
        reference=0.0,
        apply=set_field("min_opacity"),
        label_meaning="smallest opacity kept",
    ),
)

USER_CHOICES: UserChoices = {
    "GenerationSettings.motion": "the settings of the motion prior, each of its own",
    "GenerationSettings.fill": "what shows where the image hides: another scene, not a coarser one",
    "GenerationSettings.still": "whether anything may move",
    "GenerationSettings.photometric_steps": "a scene nearer to its frames, with no exact value",
    "GenerationSettings.extended_layers": "whether anything shows where the image hides",
    "GenerationSettings.without": "networks that stay out: another scene, for ablations",
    "GenerationSettings.negative_prompt": "what the video is to keep away from",
    "MotionSettings.guidance": "how strongly the prompt counts: off by default, no exact value",
    "MotionSettings.threshold": "how probable motion must be: a decision, not an approximation",
    "StepControl.max_calls": "a limit for calls; a run that meets it says so",
    "StepControl.kept_axes": "which frames' errors count, fixed by the shape of a video",
}
"""Fields that change results, and approximate nothing."""

SETTINGS_CLASSES = (GenerationSettings, MotionSettings, Guidance, StepControl)
"""Whose fields are all named above."""
