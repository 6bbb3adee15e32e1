"""One check of the report: how it runs, what it measures, and the verdict."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from diff4splat.stability.plots import Plot

Verdict = Literal["ok", "refused", "fails", "not run"]
VERDICTS: tuple[Verdict, ...] = ("ok", "refused", "fails", "not run")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a check measured."""

    error: float | None = None
    """Error to float64, 0 or above; None where there is no float64 result to compare with."""
    value_finite: bool = True
    gradient_finite: bool | None = None
    """None where nothing is differentiated."""
    note: str = ""
    plots: tuple[Plot, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """An extreme or degenerate input with a limit on its error, chosen before it is measured."""

    group: str
    name: str
    run: Callable[[], Outcome]
    limit: float = math.inf
    """Largest error that is ok."""
    error_unit: str = "relative"
    quick: bool = False
    """Whether it belongs to the quick subset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A check that has run."""

    check: Check
    verdict: Verdict
    seconds: float
    outcome: Outcome | None = None
    """None where it raised an error."""
    message: str = ""
    """The error, or what the outcome breaks."""

    @property
    def note(self) -> str:
        """The message and the note of the outcome."""
        noted = "" if self.outcome is None else self.outcome.note
        return "; ".join(part for part in (self.message, noted) if part)


class NotRunError(Exception):
    """A check needs something that this machine lacks."""


def violations(check: Check, outcome: Outcome) -> list[str]:
    """Why an outcome is not ok, in words."""
    broken = []
    if not outcome.value_finite:
        broken.append("a value is NaN or infinite")
    if outcome.gradient_finite is False:
        broken.append("a gradient is NaN or infinite")
    # NaN fails the comparison too.
    if outcome.error is not None and not outcome.error <= check.limit:
        broken.append(f"error {outcome.error:.2g} above the limit {check.limit:g}")
    return broken
