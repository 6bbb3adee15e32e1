"""``diff4splat report all``: every report, on one page."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from diff4splat.cli.calibration.skipped import Skipped
from diff4splat.cli.options.constraints import InputPath, OutFolder

if TYPE_CHECKING:
    from collections.abc import Mapping

SKIPPED_PX = 96
PAGE = "report.html"


@dataclass(frozen=True, kw_only=True)
class AllReports:
    """Error against run time, what runs leave out, and stability, on one page of pictures.

    Two processes measure at a time, each with one thread. A call that is stopped goes on where it
    was.
    """

    out: OutFolder = Path("report")
    """Folder for the page, and for the files of each report."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on what runs leave out; worlds make up the number."""
    quick: bool = False
    """Two of eight inputs and a few extreme ones: less to see in a fraction of the time."""

    def run(self) -> None:
        """Measure, write, say where the page is."""
        import time

        from diff4splat.cli.calibration.report_shares import report_shares
        from diff4splat.cli.calibration.shares import run_shares
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_tracer
        from diff4splat.error_time.subjects.inputs import require_photographs
        from diff4splat.io.figures.plots import require_matplotlib

        require_matplotlib()
        require_photographs()
        began, phases = time.perf_counter(), ConsolePhases()
        precompile_renderer(single_gaussian("cpu"), phases)
        precompile_tracer(phases)
        skipped = Skipped(out=self.out / "skipped", images=self.images, resolution=SKIPPED_PX)
        done = run_shares(report_shares(self.out, skipped, self.quick), phases)
        note(f"wrote {self.write(done, time.perf_counter() - began)}")

    def write(self, done: "Mapping[str, Any]", seconds: float) -> Path:
        """The page of all shares; what they kept for a second call goes."""
        from diff4splat.cli.calibration.report_shares import KNOBS, SKIPPED, STABILITY, joined
        from diff4splat.error_time.report import plot_file
        from diff4splat.error_time.resume import PARTIAL
        from diff4splat.error_time.tables import write_tables
        from diff4splat.io.atomic import write_text
        from diff4splat.progress.machine import this_machine
        from diff4splat.reports.full_report import FullReport
        from diff4splat.reports.page import report_page

        folder = self.out / "error-time"
        plots = {name: plot_file(folder / share, name) for share in KNOBS for name in done[share]}
        knobs = joined({name: rows for share in KNOBS for name, rows in done[share].items()})
        write_tables(folder, knobs)
        report = FullReport(
            machine=this_machine(),
            seconds=seconds,
            knobs=knobs,
            plots=[plots[result.knob.name] for result in knobs],
            skipped=done[SKIPPED].rows,
            skipped_plot=done[SKIPPED].plot,
            records=done[STABILITY],
        )
        write_text(self.out / PAGE, report_page(report))
        for share in KNOBS:
            (folder / share / PARTIAL).unlink(missing_ok=True)
        done[SKIPPED].partial.remove()
        return self.out / PAGE
