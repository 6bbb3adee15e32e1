"""``diff4splat report all``: every report, on one page."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.calibration.skipped import Skipped
from diff4splat.cli.options.constraints import InputPath, OutFolder

if TYPE_CHECKING:
    from diff4splat.progress.phases import Phases
    from diff4splat.stability.check import Record

QUICK_PX = 96
PAGE = "report.html"


@dataclass(frozen=True, kw_only=True)
class WholeReports:
    """Error against run time, what runs leave out, and stability, on one page of pictures.

    Minutes; a call that is stopped goes on where it was.
    """

    out: OutFolder = Path("report")
    """Folder for the page, and for the files of each report."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on what runs leave out; worlds make up the number."""
    quick: bool = False
    """Two of eight inputs and a few extreme ones: less to see in a quarter of the time."""

    def run(self) -> None:
        """Measure, write, say where the page is."""
        import time

        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_tracer
        from diff4splat.error_time import report as error_time
        from diff4splat.io.atomic import write_text
        from diff4splat.io.figures.plots import require_matplotlib
        from diff4splat.progress.machine import this_machine
        from diff4splat.reports.page import whole_page
        from diff4splat.reports.whole_report import WholeReport

        require_matplotlib()
        began, phases = time.perf_counter(), ConsolePhases()
        precompile_renderer(single_gaussian("cpu"), phases)
        precompile_tracer(phases)
        knobs = error_time.run(
            self.out / "error-time", phases=phases, repeats=1, quick=self.quick, keep=True
        )
        skipped = Skipped(
            out=self.out / "skipped", images=self.images, resolution=QUICK_PX
        ).measured(phases)
        report = WholeReport(
            machine=this_machine(),
            seconds=time.perf_counter() - began,
            knobs=knobs.results,
            plots=knobs.plots,
            skipped=skipped.rows,
            skipped_plot=skipped.plot,
            records=self.stability(phases),
        )
        write_text(self.out / PAGE, whole_page(report))
        knobs.partial.remove()
        skipped.partial.remove()
        note(f"wrote {self.out / PAGE}")

    def stability(self, phases: "Phases") -> "tuple[Record, ...]":
        """All checks; also as files of their own."""
        from diff4splat.stability import report
        from diff4splat.stability.known_checks import known_checks

        return report.run(self.out / "stability", known_checks(quick=self.quick), phases).records
