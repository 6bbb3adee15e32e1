"""The page of the whole report: numbers first, every picture inside, nothing measured is markup."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from diff4splat.error_time.known_knobs import known_knobs
from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.evaluation.skipped.measurement import Measured
from diff4splat.progress.machine import this_machine
from diff4splat.reports.full_report import STATIC, FullReport, headlines
from diff4splat.reports.groups import GROUPS, OTHER, group_of
from diff4splat.reports.page import report_page
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.runner import run_check

EVIL = "<script>alert(1)</script>"


def sampling(errors: dict[tuple[str, int], float]) -> SweepResult:
    knob = next(one for one in known_knobs() if one.name == "video-sampling")
    rows = []
    for setting in knob.settings:
        known = errors.get((setting.sampler, setting.steps), 1.0)
        adaptive = setting.tolerance is not None
        rows.append(
            Measurement(
                setting=setting,
                label=knob.label(setting),
                series=knob.series(setting),
                seconds=1.0,
                median_s=1.0,
                error=math.inf if adaptive else known,
            )
        )
    return SweepResult(knob=knob, repeats=0, rows=tuple(rows))


@pytest.fixture
def report(tmp_path: Path) -> FullReport:
    plot = tmp_path / "plot.png"
    Image.new("RGB", (4, 4)).save(plot)
    checks = [
        Check(group="cameras", name=EVIL, run=lambda: Outcome(error=0.0), limit=0.1),
        Check(group="motion", name="far", run=lambda: Outcome(error=1.0), limit=0.1),
    ]
    row = Measured(
        item=STATIC,
        source="a",
        full_s=2.0,
        lean_s=0.5,
        saved_bytes=1e6,
        error=0.0,
        mean_square=0.0,
    )
    return FullReport(
        machine=this_machine(),
        seconds=90.0,
        knobs=[sampling({("euler", 50): 0.06, ("fitted", 12): 0.04, ("unipc", 12): 0.1})],
        plots=[plot],
        skipped=[row],
        skipped_plot=plot,
        records=[run_check(check) for check in checks],
    )


def test_headlines_say_what_was_measured(report: FullReport) -> None:
    sampler, static, stability, defaults = headlines(report)
    assert (sampler.number, sampler.good) == ("12", True)
    assert "fitted" in sampler.detail and "euler has 0.060 with 50" in sampler.detail
    assert (static.number, static.good) == ("25%", True)
    assert "same bits" in static.detail
    assert (stability.number, stability.good) == ("1", False)
    assert defaults.number.endswith("of 1")


def test_a_sampler_that_needs_more_is_not_praised(report: FullReport) -> None:
    worse = replace(report, knobs=[sampling({("euler", 50): 0.001})])
    assert headlines(worse)[0].number == "50"
    assert not headlines(worse)[0].good


def test_the_page_stands_alone_and_nothing_is_markup(report: FullReport) -> None:
    page = report_page(report)
    assert EVIL not in page and "&lt;script&gt;" in page
    assert not re.search(r"\{\{\w+\}\}", page)
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    for anchor in re.findall(r'href="#([\w-]+)"', page):
        assert f'id="{anchor}"' in page
    assert page.count("data:image/png;base64") == 2
    assert "not finite" in page


def test_every_knob_has_a_section() -> None:
    assert {group_of(knob.name) for knob in known_knobs()} <= set(GROUPS) - {OTHER}
    assert group_of("precision") == "Rendering" != group_of("precision-dit")
    assert group_of("something") == OTHER
