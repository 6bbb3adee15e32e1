"""Tables, figures, slopes and shares, from results made up here."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from options import Options
from records import Cell, ImageError, Work, plain, timing
from report.plots import draw_all, draw_slope, short
from report.tables import Results, baseline, markdown_table, milliseconds, to_markdown
from timing.limits import BOTH_FLOPS_PER_PAIR, FORWARD_FLOPS_PER_PAIR, MachineLimits, shares
from timing.machine import this_machine
from timing.scaling import FIXED, SERIES, Point, fit, slopes
from timing.scaling import to_markdown as slope_to_markdown

from diff4splat.errors import ConfigError


def cell(peer: str, scene: str = "cloud-10k-256", ms: float = 10.0, **more) -> Cell:
    return Cell(
        peer=peer,
        scene=scene,
        threads=more.pop("threads", 1),
        forward=timing([ms / 1e3], ms / 1e3, 3 << 20),
        both=timing([3 * ms / 1e3], ms / 1e3, 9 << 20),
        **more,
    )


def results(*cells: Cell) -> Results:
    work = Work(scene="cloud-10k-256", gaussians=10_000, pixels=65_536, blended_pairs=1e6)
    limit = MachineLimits(threads=1, flops=1e11, bytes_per_s=1e10, how="guessing")
    return Results(machine=this_machine(), limits=(limit,), works=(work,), cells=cells)


def rows(markdown: str) -> dict[str, list[str]]:
    lines = [[part.strip() for part in line.strip("|").split("|")] for line in markdown.split("\n")]
    return {line[0]: line[1:] for line in lines}


def test_ratios_are_against_the_fast_one_of_ours() -> None:
    cells = [cell("reference", ms=40.0), cell("raster", ms=5.0), cell("other", ms=600.0)]
    assert baseline(cells).peer == "raster"
    found = rows(markdown_table(cells))
    assert found["reference"][:6] == ["40.0", "8.00", "3", "120", "8.00", "9"]
    assert found["raster"][1] == "1.00"
    assert found["other"][:2] == ["600", "120"]


def test_without_ours_there_are_no_ratios() -> None:
    found = rows(markdown_table([cell("other")]))
    assert found["other"][1] == "–"


def test_reasons_stand_where_figures_are_missing() -> None:
    absent = Cell(peer="absent", scene="x", threads=1, reason="needs [bold]a|b[/bold]")
    image = ImageError(psnr_db=80.0, max_error=0, wrong=2, bias=-1e-5, doubtful=1, sampled=9)
    half = cell("half", image=image, reason="backward: out of memory")
    another = cell("another", image=image, judged=False)
    found = rows(markdown_table([absent, half, another]))
    assert found["absent"][:6] == ["–"] * 6
    assert found["absent"][-1] == "needs [bold]a/b[/bold]"
    assert found["half"][6:9] == ["80.0", "2 / 1 / 9", "-1e-05"]
    assert found["half"][-1] == "right; backward: out of memory"
    assert found["another"][-1] == "not judged"


def test_a_busy_machine_is_said() -> None:
    assert "kept 0.7 cores busy" in to_markdown(results(cell("raster", others_cores=0.71)))
    assert "busy" not in to_markdown(results(cell("raster", others_cores=0.05)))


def test_the_report_holds_every_scene_and_number_of_threads() -> None:
    text = to_markdown(results(cell("raster", note="a remark"), cell("raster", threads=2)))
    assert "## cloud-10k-256, 1 thread(s)" in text
    assert "## cloud-10k-256, 2 thread(s)" in text
    assert "10,000 Gaussians, 65,536 pixels, 1e+06 blended pairs." in text
    assert "- raster: a remark" in text
    assert "100 GFLOP/s by guessing, 10 GB/s by copying" in text


def test_results_are_json_without_infinities() -> None:
    image = ImageError(psnr_db=math.inf, max_error=0, wrong=0, bias=0, doubtful=0, sampled=1)
    record = json.loads(json.dumps(plain(results(cell("raster", image=image))), allow_nan=False))
    assert record["cells"][0]["image"]["psnr_db"] is None
    assert record["cells"][0]["forward"]["best_s"] == 0.01
    assert record["machine"]["cores"] >= 1


def test_shares_are_work_over_time_over_limit() -> None:
    made = results(cell("raster", ms=1.0))
    forward = shares(made.cells[0], made.works[0], made.limits[0], backward=False)
    assert forward.ns_per_pair == pytest.approx(1.0)
    assert forward.flops == pytest.approx(FORWARD_FLOPS_PER_PAIR * 1e9)
    assert forward.flops_share == pytest.approx(FORWARD_FLOPS_PER_PAIR * 1e9 / 1e11)
    least = 4 * (14 * 10_000 + 3 * 65_536)
    assert forward.bytes_share == pytest.approx(least / 1e-3 / 1e10)
    both = shares(made.cells[0], made.works[0], made.limits[0], backward=True)
    assert both.flops == pytest.approx(BOTH_FLOPS_PER_PAIR * 1e6 / 3e-3)
    assert both.bytes_share == pytest.approx(2 * least / 3e-3 / 1e10)
    unknown = Work(scene="x", gaussians=1, pixels=1)
    assert shares(made.cells[0], unknown, made.limits[0], backward=False) is None


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.00123, "1.23"), (0.0123, "12.3"), (1.23, "1,230")]
)
def test_milliseconds_have_three_figures(seconds: float, text: str) -> None:
    assert milliseconds(seconds) == text


def test_figures_need_two_points_along_their_axis(tmp_path: Path) -> None:
    assert draw_all([cell("raster"), cell("other")], tmp_path) == []
    cells = [
        cell(peer, scene, threads=threads)
        for peer in ("raster", "other")
        for scene in ("cloud-10k-256", "cloud-100k-256", "cloud-10k-512")
        for threads in (1, 2)
    ]
    files = draw_all(cells, tmp_path)
    assert [file.name for file in files] == [
        "time-gaussians.png",
        "time-pixels.png",
        "time-threads.png",
    ]
    assert all(file.stat().st_size > 5_000 for file in files)


@pytest.mark.parametrize(("value", "text"), [(2, "2"), (65_536, "65.5k"), (1e6, "1M")])
def test_ticks_are_short(value: float, text: str) -> None:
    assert short(value) == text


@settings(max_examples=25, deadline=None)
@given(st.floats(0.1, 3.0), st.floats(1e-9, 1e-3))
def test_a_power_law_has_its_exponent_for_slope(exponent: float, factor: float) -> None:
    pairs = [1e5, 3e5, 1e6, 1e7, 1e8]
    assert fit(pairs, [factor * p**exponent for p in pairs]) == pytest.approx(exponent)


def test_slopes_are_per_series_and_kind(tmp_path: Path) -> None:
    points = [
        Point(series=name, pairs=pairs, gaussians=1, forward_s=1e-9 * pairs**power, both_s=None)
        for name, power in (("count", 1.0), ("footprint", 0.5))
        for pairs in (1e5, 1e6, 1e8)
    ]
    found = slopes(points)
    assert found["count forward"] == pytest.approx(1.0)
    assert found["footprint forward"] == pytest.approx(0.5)
    assert math.isnan(found["count both"])
    picture = Point(series=FIXED, pairs=0.0, gaussians=1, forward_s=1e-3, both_s=None)
    dearer = [replace(point, forward_s=point.forward_s + 1e-3) for point in points]
    beyond = slopes([picture, *dearer], beyond_fixed=True)
    assert beyond == pytest.approx(found, nan_ok=True)
    assert slopes([picture, *dearer])["count forward"] < 0.9
    assert "- count forward: 1.00, 1.00" in slope_to_markdown(points, "raster")
    draw_slope(points, found, tmp_path / "slope.png")
    assert (tmp_path / "slope.png").stat().st_size > 5_000


def test_a_single_point_has_no_slope() -> None:
    assert math.isnan(fit([1.0], [1.0]))


@pytest.mark.parametrize("name", ["count", "footprint"])
def test_series_span_three_decades_of_work(name: str) -> None:
    scenes = [scene for series, scene in SERIES if series == name]
    work = [scene.count * scene.make.args[0].radius_px[0] ** 2 for scene in scenes]
    assert work == sorted(work)
    assert work[-1] / work[0] >= 1000


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"seconds": 0.0}, "--seconds: expected more than 0, got 0.0"),
        ({"patience": -1.0}, "--patience: expected more than 0"),
        ({"threads": (0,)}, "--threads: expected numbers of at least 1"),
        ({"threads": ()}, "--threads: expected numbers of at least 1"),
        ({"memory_gib": 0.0}, "--memory-gib: expected more than 0"),
    ],
)
def test_options_out_of_range_are_refused(changed: dict, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Options(**changed)
    assert words in str(caught.value)


def test_effort_takes_the_memory_that_is_named() -> None:
    assert Options(memory_gib=2.0).effort().memory_bytes == 2 << 30
    assert Options().effort().memory_bytes > 0
    assert not Options().effort(checks=False).checks
