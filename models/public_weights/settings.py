"""Settings in the configurations of public models, which are read and never assumed."""

from collections.abc import Mapping
from typing import Any

from diff4splat.errors import CheckpointError

Source = Mapping[str, Any]
"""A configuration of diffusers or transformers."""


def count(source: Source, name: str, where: str) -> int:
    """A whole number above 0.

    Raises:
        CheckpointError: something else.
    """
    value = source.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise unsupported(where, name, "a whole number above 0", value)
    return value


def number(source: Source, name: str, where: str, default: float | None = None) -> float:
    """A finite number above 0; without a default it must be there.

    Raises:
        CheckpointError: something else.
    """
    value = source.get(name, default)
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < 1e9:
        raise unsupported(where, name, "a number above 0", value)
    return float(value)


def require_settings(source: Source, where: str, **wanted: object) -> None:
    """Every setting that is there must have this value.

    Raises:
        CheckpointError: one has another.
    """
    for name, value in wanted.items():
        if source.get(name, value) != value:
            raise unsupported(where, name, value, source[name])


def unsupported(where: str, name: str, expected: object, got: object) -> CheckpointError:
    """The error for a setting that no supported model has."""
    return CheckpointError(
        f"{where}: expected {name} to be {expected}, got {str(got)[:80]}; "
        "this variant cannot be imported"
    )
