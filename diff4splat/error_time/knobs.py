"""Approximation settings whose error and run time are measured against a reference.

The values of a setting range from fast to exact. ``run`` computes a result with one value,
``error`` compares it with the result of the reference value; 0 means identical.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any

from diff4splat.approximations.declaration import Approximation, require_values
from diff4splat.errors import ConfigError
from diff4splat.paths.messages import unknown_name


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproximationSetting:
    """One approximation: its values, and the reference value."""

    name: str
    """Part of file names: lower case, digits and ``-``."""
    summary: str
    """What is approximated, in one line."""
    error_unit: str
    settings: tuple[Hashable, ...]
    """Values with a readable ``str``."""
    default: Hashable
    """One of ``settings``."""
    reference: Hashable
    """The exact value; need not be in ``settings``."""
    run: Callable[[Any], Any]
    run_reference: Callable[[], Any] | None = None
    """The result of ``reference``, if something else makes it or keeps it."""
    error: Callable[[Any, Any], float]
    """(result, result of the reference) to an error of 0 or above."""
    more_errors: Callable[[Any, Any], Mapping[str, float]] = lambda result, reference: {}
    """The same by other measures, under their names with units."""
    repeats: int | None = None
    """Timed runs after the first; 0 times the first itself, where one takes seconds. None is what
    the report is asked for."""
    fields: tuple[str, ...] = ()
    """``Class.field`` of the settings that it covers."""
    declared: Approximation | None = None
    """The declaration beside the code, for settings that commands take."""
    series: Callable[[Any], str] = lambda _: ""
    """Values of one series form one curve in the plot."""
    label: Callable[[Any], str] = str
    """Short name of a setting beside its point."""
    label_meaning: str = ""
    """Meaning of the labels, if they are plain numbers."""

    def __post_init__(self) -> None:
        require_values(self.name, self.settings, self.default)


@dataclass(slots=True)
class KnobRegistry:
    """Knobs by name, in the order in which they were registered."""

    _knobs: dict[str, ApproximationSetting] = field(default_factory=dict)

    def register(self, knob: ApproximationSetting) -> None:
        """Add a knob.

        Raises:
            ConfigError: the name is taken.
        """
        if knob.name in self._knobs:
            raise ConfigError(f"knob {knob.name}: expected a new name, got one that is taken")
        self._knobs[knob.name] = knob

    def knobs(self, names: tuple[str, ...] = ()) -> tuple[ApproximationSetting, ...]:
        """All knobs, or those of the given names.

        Raises:
            ConfigError: a name is not registered.
        """
        for name in names:
            if name not in self._knobs:
                raise ConfigError(unknown_name("knob", name, self._knobs))
        return tuple(self._knobs[name] for name in names or self._knobs)
