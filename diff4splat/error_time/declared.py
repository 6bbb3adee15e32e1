"""Declarations of all packages as settings that can be measured.

A subject runs one value of a declaration on the fixed inputs, and compares with the reference.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from diff4splat.approximations.declaration import Approximation
from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.fitting import approximations as fitting
from diff4splat.fitting.settings import DensitySettings, FitSettings
from diff4splat.generation import approximations as generation
from diff4splat.generation.settings import GenerationSettings
from diff4splat.render import approximations as rendering

DECLARING = (generation, rendering, fitting)
"""Modules with ``APPROXIMATIONS``, ``USER_CHOICES`` and ``SETTINGS_CLASSES``."""


SHORT_FIT = FitSettings(
    coarse_steps=100,
    fine_steps=200,
    points=4000,
    density=DensitySettings(budget=4000, every=50),
    harmonics=0,
)
"""Some ten seconds; long enough that settings differ by more than the noise of a fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is run with a settings object, and how its result is compared.

    ``module`` is imported with the first run. It has ``run`` and ``error``, and may have
    ``more_errors``, and ``truth`` where that is known and no reference is run.
    """

    module: str
    base: Any
    """Settings of which a value replaces some."""
    error_unit: str
    known_truth: bool = False
    every: int = 1
    """Of the inputs, every n-th is run: where one takes seconds."""

    def call(self, name: str, *arguments: Any) -> Any:
        """One function of the module; nothing where there is none."""
        module = import_module(f"diff4splat.error_time.subjects.{self.module}")
        function = getattr(module, name, None)
        return None if function is None else function(*arguments)


ALL_INPUTS, FEW_INPUTS = tuple(range(8)), (1, 4)
"""Four photographs and four worlds; one of each for a quick look."""
RGB_UNIT = "RMSE of RGB in [0, 1]"
SUBJECTS: Mapping[str, Subject] = {
    "video": Subject(
        module="video",
        base=GenerationSettings(),
        error_unit="latent error over the latents' deviation",
    ),
    "motion": Subject(
        module="motion",
        base=GenerationSettings(),
        error_unit="field error over the fields' deviation",
    ),
    "scene": Subject(module="scenes", base=GenerationSettings(), error_unit=RGB_UNIT),
    "video-scene": Subject(
        module="scenes", base=GenerationSettings(fill="video"), error_unit=RGB_UNIT, every=2
    ),
    "fit": Subject(
        module="fits", base=SHORT_FIT, error_unit=f"{RGB_UNIT} to the true frames", known_truth=True
    ),
}
"""By the name that declarations use."""


def declarations() -> tuple[Approximation, ...]:
    """Of every package."""
    return tuple(one for module in DECLARING for one in module.APPROXIMATIONS)


def declared_settings(references: "References") -> tuple[ApproximationSetting, ...]:
    """Every declaration as a setting of the report; nothing is loaded before the first run."""
    return tuple(_measurable(one, references) for one in declarations())


@dataclass(slots=True)
class References:
    """Results of references, each made once for all settings of a subject."""

    inputs: tuple[int, ...] = ALL_INPUTS
    _made: dict[Hashable, Any] = field(default_factory=dict)

    def of(self, one: Approximation) -> Any:
        """The truth, or the result of the reference."""
        subject = SUBJECTS[one.subject]
        if subject.known_truth:
            return self._once((one.subject, None), lambda: subject.call("truth"))
        return self.of_settings(one.subject, one.apply(subject.base, one.reference))

    def of_settings(self, name: str, settings: Any) -> Any:
        """The result of a subject with settings."""
        run = lambda: SUBJECTS[name].call("run", settings, self.inputs_of(name))  # noqa: E731
        return self._once((name, settings), run)

    def inputs_of(self, name: str) -> tuple[int, ...]:
        """Those on which a subject is run."""
        return self.inputs[:: SUBJECTS[name].every]

    def _once(self, key: Hashable, make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


def _measurable(one: Approximation, references: References) -> ApproximationSetting:
    subject = SUBJECTS[one.subject]
    return ApproximationSetting(
        name=one.name,
        summary=one.summary,
        error_unit=subject.error_unit,
        settings=one.values,
        default=one.default,
        reference="the truth" if subject.known_truth else one.reference,
        run=lambda value: subject.call(
            "run", one.apply(subject.base, value), references.inputs_of(one.subject)
        ),
        run_reference=lambda: references.of(one),
        error=lambda *results: subject.call("error", *results),
        more_errors=lambda *results: subject.call("more_errors", *results) or {},
        series=one.series,
        label=one.label,
        label_meaning=one.label_meaning,
        repeats=0,
        fields=one.fields,
        declared=one,
    )
