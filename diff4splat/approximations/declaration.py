"""An approximation as its own code declares it: the values, the default, the exact one.

A package that approximates has a module ``approximations`` with ``APPROXIMATIONS``, and with
``USER_CHOICES``: fields of its settings that change results without approximating anything, each
with the reason. ``diff4splat.error_time`` collects both and measures the first; a test holds that
no field of a settings class is in neither.
"""

import re
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from diff4splat.errors import ConfigError

UserChoices = Mapping[str, str]
"""``Class.field`` to the reason why it is the user's choice and no approximation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Approximation:
    """Values of one or several fields, from fast to exact."""

    name: str
    """Part of file names: lower case, digits and ``-``."""
    subject: str
    """What is run to measure it, such as ``video`` or ``scene``."""
    summary: str
    """What is approximated, in one line."""
    fields: tuple[str, ...]
    """``Class.field`` of every field that a value sets."""
    values: tuple[Hashable, ...]
    """With a readable ``str``."""
    default: Hashable
    """One of ``values``: what commands use."""
    reference: Hashable
    """The exact value; need not be among ``values``."""
    apply: Callable[[Any, Any], Any]
    """(settings, value) to settings with this value."""
    series: Callable[[Any], str] = lambda _: ""
    """Values of one series form one curve in the plot."""
    label: Callable[[Any], str] = str
    """Short name of a value beside its point."""
    label_meaning: str = ""
    """Meaning of the labels, if they are plain numbers."""

    def __post_init__(self) -> None:
        require_values(self.name, self.values, self.default)


def require_values(name: str, values: tuple[Hashable, ...], default: Hashable) -> None:
    """Refuse a name or values that no report could show.

    Raises:
        ConfigError: a name with other characters, no or repeated values, or a foreign default.
    """
    if not re.fullmatch("[a-z0-9]+(-[a-z0-9]+)*", name):
        raise ConfigError(f"knob name: expected lower-case letters, digits and '-', got {name!r}")
    if not values or len(set(values)) != len(values):
        raise ConfigError(f"knob {name}: expected at least one setting, each only once")
    if default not in values:
        raise ConfigError(f"knob {name}: expected the default among its settings, got {default}")


def set_field(field: str) -> Callable[[Any, Any], Any]:
    """Replace one field of a settings object; ``motion.steps`` reaches into another."""
    first, _, rest = field.partition(".")

    def apply(settings: Any, value: Any) -> Any:
        inner = set_field(rest)(getattr(settings, first), value) if rest else value
        return replace(settings, **{first: inner})

    return apply
