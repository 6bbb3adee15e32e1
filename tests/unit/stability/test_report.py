"""Verdicts, isolation of checks, JSON, and a page in which nothing of a record is markup."""

import json
import math
import re
from pathlib import Path

import pytest
import torch

from diff4splat.errors import ConfigError, InputError
from diff4splat.progress.phases import Phases
from diff4splat.stability import report
from diff4splat.stability.check import Check, NotRunError, Outcome, Record, Verdict
from diff4splat.stability.groups import GROUPS, require_groups
from diff4splat.stability.known_checks import OF_LIBRARY, OF_MODEL
from diff4splat.stability.page.svg import curves, error_bar, heat_color, heat_map
from diff4splat.stability.plots import Curves, HeatMap, Thumbnail
from diff4splat.stability.runner import run_check
from diff4splat.stability.tables import to_json, to_markdown

EVIL = "<script>alert('x')</script> & \"quotes\" \x1b[31m"


def check(outcome: Outcome | BaseException, limit: float = 0.1, name: str = "case") -> Check:
    def run() -> Outcome:
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    return Check(group="cameras", name=name, run=run, limit=limit)


@pytest.mark.parametrize(
    "outcome, verdict",
    [
        (Outcome(error=0.1), "ok"),
        (Outcome(error=0.0, gradient_finite=True), "ok"),
        (Outcome(), "ok"),
        (Outcome(error=0.11), "fails"),
        (Outcome(error=math.nan), "fails"),
        (Outcome(error=math.inf), "fails"),
        (Outcome(error=0.0, value_finite=False), "fails"),
        (Outcome(error=0.0, gradient_finite=False), "fails"),
        (InputError("image: expected a shape"), "refused"),
        (RuntimeError("Half is not implemented"), "fails"),
        (MemoryError(), "fails"),
        (NotRunError("onnx is not installed"), "not run"),
    ],
)
def test_verdicts(outcome: Outcome | Exception, verdict: Verdict) -> None:
    record = run_check(check(outcome))
    assert record.verdict == verdict
    assert record.message or verdict == "ok"


def test_a_stop_is_no_verdict() -> None:
    with pytest.raises(KeyboardInterrupt):
        run_check(check(KeyboardInterrupt()))


def test_a_crash_is_a_row_and_the_rest_runs(tmp_path: Path) -> None:
    checks = [check(ZeroDivisionError("one")), check(Outcome(error=0.0))]
    written = report.run(tmp_path, checks, Phases())
    assert [record.verdict for record in written.records] == ["fails", "ok"]
    assert "ZeroDivisionError: one" in (tmp_path / "stability.html").read_text()
    read = json.loads((tmp_path / "stability.json").read_text())
    assert read["verdicts"] == {"ok": 1, "refused": 0, "fails": 1, "not run": 0}


def test_neither_order_nor_choice_of_checks_changes_random_numbers() -> None:
    def draw() -> Outcome:
        return Outcome(error=float(torch.rand(())))

    one = Check(group="cameras", name="one", run=draw)
    torch.rand(7)
    assert run_check(one).outcome == run_check(one).outcome


def test_json_is_valid_for_numbers_that_are_not_finite() -> None:
    heat = HeatMap(
        title="t",
        row_label="guidance",
        rows=("1",),
        column_label="steps",
        columns=("2", "4"),
        values=((math.inf, 0.5),),
        within_limit=((False, True),),
    )
    record = run_check(check(Outcome(error=math.nan, plots=(heat,))))
    read = json.loads(to_json([record], report.this_machine()))["checks"][0]
    assert read["error"] is None and read["plots"][0]["values"] == [[None, 0.5]]


def test_markdown_has_a_line_per_record() -> None:
    table = to_markdown([run_check(check(Outcome(error=0.01))), run_check(check(ConfigError("x")))])
    assert "| cameras | case | 1.0e-02 | 0.1 | finite | – |" in table
    assert table.count("\n") == 4


def test_text_of_records_is_no_markup(tmp_path: Path) -> None:
    curve = Curves(title=EVIL, x_label=EVIL, x=(0.0, 1.0), y_label="", lines=((EVIL, (1.0, 0.1)),))
    image = Thumbnail(caption=EVIL, rgb=torch.full((4, 4, 3), math.nan))
    checks = [
        check(Outcome(error=0.0, note=EVIL, plots=(curve, image)), name=EVIL),
        check(InputError(EVIL)),
    ]
    report.run(tmp_path, checks)
    page = (tmp_path / "stability.html").read_text()
    assert "<script" not in page and "\x1b" not in page and "{{" not in page
    # One page without any other file.
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)


def test_plots_of_extreme_numbers() -> None:
    empty = Curves(title="t", x_label="x", x=(0.0,), y_label="y", lines=(("a", (0.0,)),))
    lost = Curves(
        title="t", x_label="x", x=(0.0, 1.0), y_label="y", lines=(("a", (math.nan, math.inf)),)
    )
    for plot in (empty, lost):
        assert curves(plot).startswith("<svg")
    for value in (0.0, 1e-300, 1.0, 1e300, math.inf, math.nan):
        assert re.fullmatch("#[0-9a-f]{6}", heat_color(value))
        assert "nan" not in error_bar(value, 0.1)
    assert heat_color(1e-9) == heat_color(0.0) != heat_color(0.5)


def test_cells_that_are_not_usable_are_crossed_out() -> None:
    grid = {"rows": ("1",), "columns": ("2", "4"), "values": ((0.5, 0.01),)}
    labels = {"title": "t", "row_label": "r", "column_label": "c"}
    assert heat_map(HeatMap(**grid, **labels, within_limit=((False, True),))).count("cross") == 1


def test_every_group_has_checks() -> None:
    assert set(GROUPS) == {*OF_MODEL, *OF_LIBRARY}


def test_unknown_groups_are_refused() -> None:
    require_groups(["samplers"])
    with pytest.raises(ConfigError, match="samplers"):
        require_groups(["smaplers"])


def test_a_record_without_an_outcome_has_its_message_as_note() -> None:
    record = Record(check=check(Outcome()), verdict="refused", seconds=0.0, message="too wide")
    assert record.note == "too wide"
