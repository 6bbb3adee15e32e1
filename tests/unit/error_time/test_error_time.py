"""Tables, plots and the command that writes them."""

import json
import math
import sys
from pathlib import Path

import pytest
import torch
from PIL import Image

from diff4splat.error_time import error_plot
from diff4splat.error_time import report as error_time
from diff4splat.error_time.error_plot import save_error_time_plot
from diff4splat.error_time.knobs import ApproximationSetting, KnobRegistry
from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.error_time.tables import to_json, to_markdown
from diff4splat.errors import ConfigError, InputError, MissingExtraError, OutputError
from diff4splat.geometry.camera import pinhole
from diff4splat.outputs.path_plot import save_path_preview, speeds, turn_rates
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.machine import this_machine
from diff4splat.progress.phases import Phases


def knob(name: str = "digits", **changes: object) -> ApproximationSetting:
    values: dict[str, object] = {
        "name": name,
        "summary": "rounding pi",
        "error_unit": "absolute error",
        "settings": (0, 2, 4),
        "default": 2,
        "reference": 15,
        "run": lambda digits: torch.tensor(round(torch.pi, digits), dtype=torch.float64),
        "error": lambda result, reference: float((result - reference).abs()),
    }
    return ApproximationSetting(**{**values, **changes})


def measured(errors: list[float], seconds: list[float] | None = None, **changes) -> SweepResult:
    seconds = [0.001 * (i + 1) for i in range(len(errors))] if seconds is None else seconds
    settings = tuple(range(len(errors)))
    rows = [
        Measurement(setting=s, label=str(s), series="", seconds=t, median_s=t, error=e)
        for s, t, e in zip(settings, seconds, errors, strict=True)
    ]
    made = knob(settings=settings, default=0, **changes)
    return SweepResult(knob=made, repeats=3, rows=tuple(rows))


def turning_path(frames: int, step: float = 0.1, turn_rad: float = 0.02) -> CameraPath:
    angle = turn_rad * torch.arange(frames, dtype=torch.float64)
    pose = torch.eye(4, dtype=torch.float64).repeat(frames, 1, 1)
    pose[:, 0, 0] = pose[:, 2, 2] = angle.cos()
    pose[:, 0, 2], pose[:, 2, 0] = angle.sin(), -angle.sin()
    pose[:, 0, 3] = step * torch.arange(frames)
    cameras = pinhole(40.0, (20, 30), dtype=torch.float64).with_pose(pose)
    return CameraPath(cameras=cameras, times_s=torch.arange(frames, dtype=torch.float64) / 8)


def test_json_holds_every_row_and_the_machine() -> None:
    record = json.loads(to_json([measured([0.1, math.inf, 0.0])], this_machine()))
    assert record["machine"]["torch"] == torch.__version__
    assert record["machine"]["threads"] == torch.get_num_threads()
    assert "of this machine" in record["note"]
    table = record["knobs"][0]
    assert (table["name"], table["default"], table["reference"]) == ("digits", "0", "15")
    assert [row["error"] for row in table["rows"]] == [0.1, None, 0.0]
    assert [row["pareto"] for row in table["rows"]] == [True, False, True]
    assert table["rows"][1]["seconds"] == 0.002


def test_markdown_is_a_table_per_knob() -> None:
    lines = to_markdown([measured([0.1, math.inf, 0.0])], this_machine()).splitlines()
    assert "## digits" in lines
    assert "| **0** (default) | 1 | 1.00e-01 | ● |" in lines
    assert "| 1 | 2 | not finite |  |" in lines
    assert "| 2 | 3 | 0.00e+00 | ● |" in lines


@pytest.mark.parametrize(
    "result",
    [
        measured([0.1, 0.01, 1e-7]),
        measured([0.1, 0.0]),
        measured([0.0]),
        measured([math.inf, 0.1]),
        measured([math.inf]),
        measured([0.2, 0.2], [3.0, 3.0]),
        measured([1e-30, 1e30], [1e-9, 1e9]),
        measured([0.1, 0.2], series=lambda s: f"series {s}", label_meaning="numbers"),
    ],
    ids=["plain", "zero", "only zero", "lost default", "all lost", "equal", "extreme", "series"],
)
def test_any_sweep_can_be_drawn(result: SweepResult, tmp_path: Path) -> None:
    save_error_time_plot(result, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as image:
        assert image.size == (1024, 672)
        assert image.convert("L").getextrema() == (0, 255)


@pytest.mark.parametrize(
    "path",
    [turning_path(5), turning_path(1), turning_path(2, step=0.0), turning_path(3, 1e6, 3.0)],
    ids=["plain", "one frame", "on the spot", "far"],
)
def test_any_path_can_be_drawn(path: CameraPath, tmp_path: Path) -> None:
    save_path_preview(path, tmp_path / "path.png", "a $title_$ with {signs}")
    with Image.open(tmp_path / "path.png") as image:
        assert image.size == (1216, 1024)


def test_speed_and_turning() -> None:
    path = turning_path(4, step=0.1, turn_rad=0.02)
    torch.testing.assert_close(speeds(path), torch.full((3,), 0.8, dtype=torch.float64))
    want = torch.full((3,), math.degrees(0.16), dtype=torch.float64)
    torch.testing.assert_close(turn_rates(path), want)


def test_an_empty_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="camera path: expected at least one camera pose"):
        save_path_preview(turning_path(0), tmp_path / "path.png", "empty")


def test_run_writes_everything(tmp_path: Path) -> None:
    registry = KnobRegistry()
    registry.register(knob())
    registry.register(knob("digits-again", settings=(0, 1), default=1))
    phases = Phases()
    written = error_time.run(tmp_path / "new", repeats=1, phases=phases, registry=registry)
    names = [file.name for file in written.files]
    assert names == [
        "error-time.json",
        "error-time.md",
        "error-time-digits.png",
        "error-time-digits-again.png",
    ]
    assert all(file.is_file() for file in written.files)
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(names)
    assert written.table == (tmp_path / "new" / "error-time.md").read_text()
    assert list(phases.seconds) == ["digits", "digits-again"]


def test_run_takes_the_named_knobs_only(tmp_path: Path) -> None:
    registry = KnobRegistry()
    registry.register(knob())
    registry.register(knob("other"))
    written = error_time.run(tmp_path, names=["other"], repeats=1, registry=registry)
    assert [result.knob.name for result in written.results] == ["other"]
    with pytest.raises(ConfigError, match="knob: expected one of digits, other; got 'nothing'"):
        error_time.run(tmp_path, names=["nothing"], registry=registry)


def test_missing_matplotlib_is_found_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(setting: object) -> torch.Tensor:
        raise AssertionError("nothing may be measured")

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    registry = KnobRegistry()
    registry.register(knob(run=refuse))
    with pytest.raises(MissingExtraError, match=r"pip install 'diff4splat\[plot\]'"):
        error_time.run(tmp_path, registry=registry)
    assert not list(tmp_path.iterdir())


def test_an_unwritable_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="expected to write here"):
        save_error_time_plot(measured([0.1]), tmp_path / "file" / "plot.png")


def test_drawing_leaves_no_global_state(tmp_path: Path) -> None:
    save_error_time_plot(measured([0.1, 0.01]), tmp_path / "plot.png")
    assert "matplotlib.pyplot" not in sys.modules


def test_an_error_of_zero_is_drawn_below_all_others() -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    error_plot.draw(axes, measured([0.1, 0.01, 0.0]))
    points = next(line for line in axes.lines if line.get_marker() == "o")
    assert points.get_ydata() == pytest.approx([0.1, 0.01, 0.003])
    assert points.get_xdata() == pytest.approx([1.0, 2.0, 3.0])  # milliseconds
    assert "error 0" in [text.get_text() for text in axes.texts]
