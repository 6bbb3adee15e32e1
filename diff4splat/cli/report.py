"""``diff4splat report``: error against run time of every approximation, and stability."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from diff4splat.cli.options.constraints import Number, OutFolder
from diff4splat.cli.options.models import ModelName


@dataclass(frozen=True, kw_only=True)
class ErrorTime:
    """Sweep approximations: a table, a plot with the Pareto front and JSON for each."""

    out: OutFolder = Path("error-time")
    """Folder for the results."""
    knob: tuple[str, ...] = ()
    """Approximation settings to sweep, as listed by `diff4splat report knobs`. Default: all."""
    repeats: Annotated[int, Number(least=1)] = 3
    """Timed runs per setting; the fastest is reported. Settings that take seconds run once."""
    quick: bool = False
    """Two of the eight inputs: a look in a quarter of the time."""

    def run(self) -> None:
        """Measure, write, and print the table."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.error_time import report as error_time

        if self.out.exists() and any(self.out.glob("error-time.partial.json")):
            note("going on from an interrupted report")
        phases = ConsolePhases()
        # Knobs of the renderer must not count its compilation.
        precompile_renderer(single_gaussian("cpu"), phases)
        written = error_time.run(self.out, self.knob, self.repeats, phases, quick=self.quick)
        print(written.table)
        note(f"wrote {', '.join(file.name for file in written.files)} to {self.out}")


@dataclass(frozen=True, kw_only=True)
class ListKnobs:
    """List every approximation setting with its values and default."""

    def run(self) -> None:
        """Print name, default and values of every setting."""
        from diff4splat.error_time.known_knobs import known_knobs

        for knob in known_knobs():
            settings = ", ".join(str(setting) for setting in knob.settings)
            print(f"{knob.name}: {knob.summary}\n  default {knob.default}; settings {settings}")


@dataclass(frozen=True, kw_only=True)
class Stability:
    """Run extreme and degenerate inputs against float64: one page and one JSON file."""

    out: OutFolder = Path("stability")
    """Folder for the results."""
    only: tuple[str, ...] = ()
    """Groups of checks to run, such as samplers or cameras. Default: all."""
    model: Annotated[str, ModelName()] = "small"
    """Model folder with PyTorch weights, or a size."""
    quick: bool = False
    """A few checks of each group, in less than half a minute."""

    def check(self) -> None:
        """Refuse unknown groups."""
        from diff4splat.stability.groups import require_groups

        require_groups(self.only)

    def run(self) -> None:
        """Measure, write, and print what is not ok."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_tracer
        from diff4splat.stability import report
        from diff4splat.stability.known_checks import known_checks
        from diff4splat.stability.tables import count_verdicts, to_markdown

        checks, phases = (
            known_checks(self.only, model=self.model, quick=self.quick),
            ConsolePhases(),
        )
        # Seconds must not count compilation.
        precompile_renderer(single_gaussian("cpu"), phases)
        precompile_tracer(phases)
        written = report.run(self.out, checks, phases)
        unusual = [record for record in written.records if record.verdict != "ok"]
        print(to_markdown(unusual) if unusual else "every check is ok")
        counts = ", ".join(
            f"{n} {verdict}" for verdict, n in count_verdicts(written.records).items()
        )
        note(f"{counts}; wrote {', '.join(file.name for file in written.files)} to {self.out}")
