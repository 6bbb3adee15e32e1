"""Progress bars, notes and one-line errors, all on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from diff4splat.progress.phases import Advance, Phases

CONSOLE = Console(stderr=True, highlight=False)


class ConsolePhases(Phases):
    """Phases with one progress bar each."""

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
        )
        with Progress(*columns, console=CONSOLE) as progress:
            task = progress.add_task(name, total=steps)
            yield lambda: progress.advance(task)
            if not progress.tasks[task].completed:
                progress.update(task, completed=steps)


def note(text: str) -> None:
    """Print one line of information."""
    CONSOLE.print(text, markup=False, soft_wrap=True)


def fail(error: Exception) -> None:
    """Print an error in one line."""
    line = " ".join(str(error).split())
    CONSOLE.print(f"diff4splat: {line}", style="bold red", markup=False, soft_wrap=True)
