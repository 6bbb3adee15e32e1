"""The whole report in shares: all knobs once, two processes, steps counted, errors passed on."""

from pathlib import Path

import pytest

from diff4splat.cli.calibration import report_shares
from diff4splat.cli.calibration.all_reports import PAGE, AllReports
from diff4splat.cli.calibration.shares import Share, run_shares
from diff4splat.cli.calibration.skipped import Skipped
from diff4splat.error_time.known_knobs import known_knobs
from diff4splat.progress.phases import Phases


def test_every_knob_is_in_one_share() -> None:
    shares = report_shares.names_of_shares()
    named = [name for names in shares.values() for name in names]
    assert sorted(named) == sorted(knob.name for knob in known_knobs())
    assert all(shares.values())
    assert "precision" in shares["rendering"] and "precision-vae" in shares["fill"]


def test_shares_count_their_steps(tmp_path: Path) -> None:
    quick, full = (
        report_shares.report_shares(tmp_path, Skipped(out=tmp_path), quick)
        for quick in (True, False)
    )
    assert [share.name for share in quick] == [share.name for share in full]
    assert all(share.steps > 0 for share in full)
    assert sum(one.steps for one in quick) < sum(one.steps for one in full)


class Counted(Phases):
    """Counts steps."""

    done = 0

    def bar(self, name: str, steps: int):
        from contextlib import contextmanager

        @contextmanager
        def count():
            def advance() -> None:
                self.done += 1

            yield advance

        return count()


def test_shares_run_in_processes_and_an_error_ends_all() -> None:
    phases = Counted()
    done = run_shares([Share(name=name, steps=3, run=repr) for name in "ab"], phases)
    assert set(done) == {"a", "b"} and "StepPhases" in done["a"]
    assert phases.done == 6
    with pytest.raises(TypeError, match="int"):
        run_shares([Share(name="a", steps=1, run=int)], Phases())


def test_the_page_is_made_of_all_shares(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from diff4splat.evaluation.skipped.measurement import Measured
    from diff4splat.evaluation.skipped.partial_rows import PartialRows
    from diff4splat.evaluation.skipped.skipped_report import SkippedReport, write_skipped

    names = {share: () for share in report_shares.KNOBS} | {"rendering": ("sh-degree",)}
    monkeypatch.setattr(report_shares, "names_of_shares", lambda: names)
    row = Measured(
        item="depth", source="a", full_s=1.0, lean_s=0.5, saved_bytes=1, error=0.0, mean_square=0.0
    )
    files = write_skipped([row], tmp_path / "skipped")
    partial = PartialRows(tmp_path / "skipped", {})
    done = {share: {} for share in report_shares.KNOBS}
    done["rendering"] = report_shares.measure_knobs(
        tmp_path / "error-time" / "rendering", ("sh-degree",), True, Phases()
    )
    done["skipped"] = SkippedReport(rows=[row], files=files, partial=partial)
    done["stability"] = ()
    page = AllReports(out=tmp_path).write(done, 60.0)
    assert page == tmp_path / PAGE and "sh-degree" in page.read_text()
    assert (tmp_path / "error-time" / "error-time.json").exists()
    assert not list(tmp_path.rglob("*.partial.json"))
