"""Declarations of all packages as settings that can be measured.

A subject runs one value of a declaration on the fixed inputs, and compares with the reference.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any

from diff4splat.approximations.declaration import Approximation
from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.fitting import approximations as fitting
from diff4splat.generation import approximations as generation
from diff4splat.generation.settings import GenerationSettings
from diff4splat.render import approximations as rendering

DECLARING = (generation, rendering, fitting)
"""Modules with ``APPROXIMATIONS``, ``USER_CHOICES`` and ``SETTINGS_CLASSES``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is run with a settings object, and how its result is compared."""

    base: Any
    """Settings of which a value replaces some."""
    run: Callable[[Any], Any]
    error: Callable[[Any, Any], float]
    error_unit: str
    more_errors: Callable[[Any, Any], Mapping[str, float]] = lambda result, reference: {}
    truth: Callable[[], Any] | None = None
    """What results are compared with, where that is known; else the result of the reference."""


def subjects() -> Mapping[str, Subject]:
    """By the name that declarations use."""
    from diff4splat.error_time.subjects import fits, motion, scenes, video

    images = {"run": scenes.generated_scenes, "error": scenes.image_rmse}
    images |= {"error_unit": "RMSE of RGB in [0, 1]", "more_errors": scenes.scene_errors}
    return {
        "video": Subject(
            base=GenerationSettings(),
            run=video.sampled_latents,
            error=video.latent_error,
            error_unit="latent error over the latents' deviation",
            more_errors=video.video_errors,
        ),
        "motion": Subject(
            base=GenerationSettings(),
            run=motion.sampled_motion,
            error=motion.motion_error,
            error_unit="field error over the fields' deviation",
        ),
        "scene": Subject(base=GenerationSettings(), **images),
        "video-scene": Subject(base=GenerationSettings(fill="video"), **images),
        "fit": Subject(
            base=fits.SHORT_FIT,
            run=fits.fitted_frames,
            error=fits.frame_rmse,
            error_unit="RMSE of RGB in [0, 1] to the true frames",
            more_errors=fits.frame_errors,
            truth=fits.true_frames,
        ),
    }


def declarations() -> tuple[Approximation, ...]:
    """Of every package."""
    return tuple(one for module in DECLARING for one in module.APPROXIMATIONS)


def declared_settings() -> tuple[ApproximationSetting, ...]:
    """Every declaration as a setting of the report; nothing is loaded before the first run."""
    references = _References()
    return tuple(_measurable(one, references) for one in declarations())


@dataclass(slots=True)
class _References:
    """Results of references, each made once for all settings of a subject."""

    made: dict[Hashable, Any] = field(default_factory=dict)

    def run(self, subject: str, settings: Any) -> Any:
        key = (subject, settings)
        if key not in self.made:
            chosen = subjects()[subject]
            self.made[key] = chosen.truth() if chosen.truth else chosen.run(settings)
        return self.made[key]


def _measurable(one: Approximation, references: _References) -> ApproximationSetting:
    def subject() -> Subject:
        return subjects()[one.subject]

    def run(value: Any) -> Any:
        return subject().run(one.apply(subject().base, value))

    return ApproximationSetting(
        name=one.name,
        summary=one.summary,
        error_unit=subject().error_unit,
        settings=one.values,
        default=one.default,
        reference="the truth" if subject().truth else one.reference,
        run=run,
        run_reference=lambda: references.run(one.subject, one.apply(subject().base, one.reference)),
        error=lambda result, reference: subject().error(result, reference),
        more_errors=lambda result, reference: subject().more_errors(result, reference),
        series=one.series,
        label=one.label,
        label_meaning=one.label_meaning,
        repeats=0,
        fields=one.fields,
        declared=one,
    )
