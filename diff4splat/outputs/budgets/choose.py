"""The cheapest setting that holds a tolerance, or the most exact one that fits a budget."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from diff4splat.errors import ConfigError
from diff4splat.outputs.budgets.costs import Forecast, duration, gigabytes
from diff4splat.outputs.budgets.limits import Limits, loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

MARGIN = 1.25
"""Forecasts of time must fit the budget with this to spare, since they are a quarter off at times;
memory with half of that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A setting with what it is expected to cost and to lose."""

    values: SettingValues
    expected: Forecast
    error: float
    """Mean square error against the reference."""

    @property
    def loss_db(self) -> float:
        """The same as a loss of PSNR."""
        return loss_from_error(self.error)

    def __str__(self) -> str:
        named = ", ".join(
            f"{name.replace('_', ' ')} {value}" for name, value in self.values.items()
        )
        return f"{named}: {self.expected}, at most {self.loss_db:.2g} dB lost"


def agrees(values: SettingValues, fixed: SettingValues) -> bool:
    """Whether a setting leaves alone what the user has ``fixed``."""
    return all(values.get(name, value) == value for name, value in fixed.items())


def choose(options: Sequence[Choice], limits: Limits) -> Choice:
    """The cheapest within a tolerance, else the most exact within the budget.

    Raises:
        ConfigError: none holds; says what is possible.
    """
    if not options:
        raise ConfigError(
            "--tolerance, --budget: expected a setting that may be chosen, got all of them given; "
            "leave one of them out"
        )
    exact = [one for one in options if one.error <= limits.error]
    if not exact:
        best = min(options, key=lambda one: one.error)
        raise ConfigError(
            f"--tolerance: expected at least {_up(best.loss_db)} dB, which is reached in "
            f"{duration(best.expected.seconds)}, got {limits.tolerance_db:g} dB"
        )
    fitting = [one for one in exact if _fits(one.expected, limits)]
    if not fitting:
        raise ConfigError(_too_small(exact, limits))
    if limits.tolerance_db is not None:
        return min(fitting, key=lambda one: (one.expected.cpu_seconds, one.error))
    return min(fitting, key=lambda one: (one.error, one.expected.cpu_seconds))


def broken(limits: Limits, measured: Mapping[str, float | int]) -> str | None:
    """One line about limits that the run did not hold; None if it held all."""
    allowed = {
        "loss_db": (limits.tolerance_db, "a loss of {:.3g} dB"),
        "seconds": (limits.seconds, "{:.3g} s"),
        "memory_bytes": (limits.memory_bytes, "{:.3g} bytes of memory"),
    }
    parts = [
        f"expected at most {words.format(most)}, got {measured[name]:.3g}"
        for name, (most, words) in allowed.items()
        if most is not None and name in measured and measured[name] > most
    ]
    return f"limit not held: {'; '.join(parts)}" if parts else None


def _fits(expected: Forecast, limits: Limits) -> bool:
    time = limits.seconds is None or expected.seconds * MARGIN <= limits.seconds
    slack = 1 + (MARGIN - 1) / 2
    return time and (
        limits.memory_bytes is None or expected.memory_bytes * slack <= limits.memory_bytes
    )


def _too_small(options: Sequence[Choice], limits: Limits) -> str:
    fastest = min(options, key=lambda one: one.expected.seconds)
    smallest = min(options, key=lambda one: one.expected.memory_bytes)
    loss = "" if limits.tolerance_db is None else f" within {limits.tolerance_db:g} dB"
    asked = Limits(seconds=limits.seconds, memory_bytes=limits.memory_bytes)
    return (
        f"--budget: expected at least {duration(fastest.expected.seconds * MARGIN)} and "
        f"{gigabytes(smallest.expected.memory_bytes * (1 + (MARGIN - 1) / 2))}, which are possible"
        f"{loss}, got {asked}"
    )


def _up(value: float) -> str:
    """Two digits, rounded up, so that what a message names is enough."""
    text = f"{value:.2g}"
    return text if float(text) >= value else f"{value * 1.05:.2g}"
