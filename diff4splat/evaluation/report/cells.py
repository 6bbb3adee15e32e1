"""Cells of Markdown tables: titles, numbers, means with their intervals."""

from collections.abc import Sequence

from diff4splat.evaluation.columns import Column
from diff4splat.evaluation.report.summary import Mean
from diff4splat.evaluation.runner import Outcome

DIRECTION_ARROWS = {"higher": "↑", "lower": "↓", "neither": ""}


def system_name(outcome: Outcome) -> str:
    """Name of the system, marked if it is untrained."""
    identity = outcome.setup.system.identity
    marks = ["untrained"] if identity.untrained else []
    return f"{identity.name} ({', '.join(marks)})" if marks else identity.name


def title(column: Column) -> str:
    """Title of a column with its better direction."""
    return f"{column.title} {DIRECTION_ARROWS[column.better]}".rstrip()


def number(value: float, sign: str = "") -> str:
    """Four significant digits, in fixed notation where possible."""
    return f"{value:{sign}.4g}"


def mean_text(mean: Mean | None, sign: str = "") -> str:
    """A mean with its interval; empty for None."""
    if mean is None:
        return ""
    if mean.low is None or mean.high is None:
        return number(mean.value, sign)
    low, high = number(mean.low, sign), number(mean.high, sign)
    return f"{number(mean.value, sign)} [{low}, {high}]"


def line(cells: Sequence[str]) -> str:
    """One row of a table."""
    return f"| {' | '.join(cells)} |"


def head(titles: Sequence[str]) -> list[str]:
    """Titles of a table whose first column holds the names of its rows."""
    return [line(["", *titles]), line(["---", *["---:"] * len(titles)])]
