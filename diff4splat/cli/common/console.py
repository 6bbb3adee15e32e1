"""Progress bars, notes and one-line errors, all on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from diff4splat.progress.phases import Advance, Phases
from diff4splat.progress.plain_text import plain_text

CONSOLE = Console(stderr=True, highlight=False)
SPEED_PERIOD_S = 600.0
"""Steps of the last minutes give the time that remains; one may take minutes."""


class RemainingColumn(TimeRemainingColumn):
    """Time that remains, while there are steps to go and two of them were seen."""

    def render(self, task: Task) -> Text:
        """Hours, minutes and seconds."""
        if task.finished or task.time_remaining is None:
            return Text("")
        return super().render(task) + Text(" left")


class ConsolePhases(Phases):
    """Phases with one progress bar each: steps, time so far and time left."""

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """The progress bar of one phase; it stays on screen after the phase.

        Phases that stop early keep their count; phases that report no steps end at 100 %.
        """
        columns = (
            TextColumn("{task.description:<14}"),
            BarColumn(bar_width=28),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            RemainingColumn(),
        )
        period_s = SPEED_PERIOD_S
        with Progress(*columns, console=CONSOLE, speed_estimate_period=period_s) as progress:
            task = progress.add_task(name, total=steps)
            yield lambda: progress.advance(task)
            if not progress.tasks[task].completed:
                progress.update(task, completed=steps)


def note(text: str) -> None:
    """Print one line of information."""
    CONSOLE.print(plain_text(text), markup=False, soft_wrap=True)


def fail(error: Exception) -> None:
    """Print an error in one line."""
    line = plain_text(" ".join(str(error).split()))
    CONSOLE.print(f"diff4splat: {line}", style="bold red", markup=False, soft_wrap=True)
