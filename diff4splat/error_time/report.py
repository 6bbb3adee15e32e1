"""``diff4splat report error-time``: sweep knobs, write JSON, a table and one plot per knob."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from diff4splat.error_time.declared import ALL_INPUTS, FEW_INPUTS
from diff4splat.error_time.error_plot import save_error_time_plot
from diff4splat.error_time.knobs import KnobRegistry
from diff4splat.error_time.known_knobs import register_known_knobs
from diff4splat.error_time.resume import PartialReport
from diff4splat.error_time.sweep import SweepResult, steps_of, sweep
from diff4splat.error_time.tables import to_markdown, write_tables
from diff4splat.io.figures.plots import require_matplotlib
from diff4splat.progress.machine import this_machine
from diff4splat.progress.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorTimeReport:
    """What was measured, and the files that hold it."""

    results: tuple[SweepResult, ...]
    files: tuple[Path, ...]

    @property
    def table(self) -> str:
        """Everything as Markdown."""
        return to_markdown(self.results, this_machine())


def run(
    out: Path,
    names: Sequence[str] = (),
    repeats: int = 3,
    phases: Phases | None = None,
    registry: KnobRegistry | None = None,
    quick: bool = False,
    keep: bool = False,
) -> ErrorTimeReport:
    """Measure the named knobs, or all, and write everything into the folder ``out``.

    A run that was stopped goes on after the last complete knob.

    ``registry`` defaults to the known knobs; ``quick`` runs them on two of the eight inputs. With
    ``keep`` the folder keeps every row for another run.

    Raises:
        ConfigError: an unknown knob, or ``repeats`` below 1.
        MissingExtraError: matplotlib is not installed; found before anything is measured.
        OutputError: ``out`` cannot be written.
    """
    phases = Phases() if phases is None else phases
    if registry is None:
        registry = KnobRegistry()
        register_known_knobs(registry, FEW_INPUTS if quick else ALL_INPUTS)
    knobs = registry.knobs(tuple(names))
    require_matplotlib()
    results, partial = [], PartialReport(out, {"repeats": repeats, "quick": quick})
    for knob in knobs:
        known = partial.known(knob)
        if len(known) < len(knob.settings):
            with phases.phase(knob.name, steps_of(knob, repeats, len(known))) as advance:
                result = sweep(knob, repeats, advance, known=known)
        else:
            result = sweep(knob, repeats, known=known)
        results.append(result)
        partial.add(result)
    files = list(write_tables(out, results))
    for result in results:
        files.append(plot_file(out, result.knob.name))
        save_error_time_plot(result, files[-1])
    if not keep:
        partial.remove()
    return ErrorTimeReport(results=tuple(results), files=tuple(files))


def plot_file(folder: Path, knob: str) -> Path:
    """Where the plot of a knob lies in the folder of a report."""
    return folder / f"error-time-{knob}.png"
