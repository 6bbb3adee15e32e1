"""A calibration measures once, goes on where it stopped, and writes a table that commands find."""

from pathlib import Path

import pytest
import torch

from diff4splat.cli.calibration import (
    calibration_errors,
    calibration_inputs,
    calibration_runs,
)
from diff4splat.cli.calibration.calibrate import Calibrate
from diff4splat.cli.calibration.calibration_record import MEASURED, CalibrationRecord
from diff4splat.cli.calibration.measured_process import MeasuredProcess
from diff4splat.cli.calibration.scene_errors import scene_errors
from diff4splat.errors import Diff4SplatError
from diff4splat.geometry.camera import pinhole, stack_cameras
from diff4splat.outputs.budgets.table import find_table, read_table
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene


def test_numbers_are_measured_once_and_kept(tmp_path: Path) -> None:
    record = CalibrationRecord(tmp_path / "parts", {"train": False})
    assert record.once("a", lambda: 1.5) == 1.5
    again = CalibrationRecord(tmp_path / "parts", {"train": False})
    assert again.once("a", lambda: pytest.fail("measured twice")) == 1.5
    other = CalibrationRecord(tmp_path / "parts", {"train": True})
    assert other.numbers == {}
    other.remove()
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["", "[1]", '{"key": {}}', "\x00\x01"])
def test_a_damaged_record_starts_anew(text: str, tmp_path: Path) -> None:
    (tmp_path / MEASURED).write_text(text)
    (tmp_path / "left-over").write_text("x")
    assert CalibrationRecord(tmp_path, {}).numbers == {}
    assert not any(tmp_path.iterdir())


class Machine:
    """Stands in for processes: a command costs a start and one second per unit of work."""

    def __init__(self, stop_after: int = 10**9) -> None:
        self.runs: list[list[str]] = []
        self.stop_after = stop_after

    def __call__(self, arguments: list[str]) -> MeasuredProcess:
        if len(self.runs) == self.stop_after:
            raise Diff4SplatError("stopped")
        self.runs.append(arguments)
        seconds = 2.0 + len(arguments)
        return MeasuredProcess(seconds=9.0, cpu_seconds=seconds, memory_bytes=5e8, text="")


def fake_work(arguments: list[str]) -> tuple[str, dict[str, float]]:
    words = 2 if arguments[0] == "export" else 1
    return " ".join(arguments[:words]), {"start": 1, "filmed_pixels": len(arguments)}


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Machine:
    made = Machine()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(calibration_runs, "measure_process", made)
    monkeypatch.setattr("diff4splat.cli.calibration.measured_process.measure_process", made)
    monkeypatch.setattr(calibration_runs, "command_work", fake_work)
    monkeypatch.setattr(calibration_runs, "measure_speed_s", lambda: 0.01)
    photos = [tmp_path / "cache" / "world.png"]
    monkeypatch.setattr(calibration_inputs, "draw_photos", lambda _: photos)
    monkeypatch.setattr(calibration_inputs, "widen_scene", lambda _, file: file)
    return made


def test_a_calibration_that_stopped_goes_on_and_ends(machine: Machine, tmp_path: Path) -> None:
    machine.stop_after = 12
    file = tmp_path / "mine.json"
    with pytest.raises(Diff4SplatError, match="stopped"):
        Calibrate(out=file, rates_only=True).run()
    assert not file.exists()
    machine.stop_after = 10**9
    Calibrate(out=file, rates_only=True).run()
    assert len({tuple(run) for run in machine.runs}) == len(machine.runs)
    table = read_table(file)
    assert table.speed_s == pytest.approx(0.01)
    for name in ("generate", "render", "bake", "export html", "fit"):
        seconds, words = table.rates[name].seconds, name.split()
        count = next(len(run) for run in machine.runs if run[: len(words)] == words)
        expected = seconds["start"] + count * seconds["filmed_pixels"]
        assert expected == pytest.approx(2 + count, rel=0.02)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["mine.json"]


def test_rates_that_were_not_measured_are_scaled(machine: Machine, tmp_path: Path) -> None:
    shipped, file = find_table(), tmp_path / "mine.json"
    Calibrate(out=file, rates_only=True).run()
    made, times = read_table(file), 0.01 / shipped.speed_s
    for name, rate in shipped.rates["train"].seconds.items():
        assert made.rates["train"].seconds[name] == pytest.approx(times * rate)
    assert made.settings == shipped.settings


def test_scene_commands_start_alike_but_renders_do_not() -> None:
    def runs(start_s: float) -> list[tuple[dict[str, float], float, float]]:
        return [({"start": 1, "work": n}, start_s + n, 1e8) for n in (0, 1, 5)]

    measured = {"render": runs(3.0), "bake": runs(1.5), "export html": runs(1.5)[1:]}
    found = calibration_runs.rates_together(measured)
    starts = {name: rates.seconds["start"] for name, rates in found.items()}
    assert starts == pytest.approx({"render": 3.0, "bake": 1.5, "export html": 1.5}, rel=1e-3)


def test_gaussians_of_a_fit_cost_time_in_its_steps_alone() -> None:
    """Fits of few steps, where what is held grows with the sum over the steps."""
    work = [
        {"start": 1.0, "fit_steps static": steps, "fitted_gaussians": steps * held}
        | {"held_gaussians": held}
        for steps, held in ((100, 10), (100, 100), (150, 50))
    ]
    seconds = [3 + 0.01 * one["fit_steps static"] + 1e-3 * one["fitted_gaussians"] for one in work]
    found = calibration_runs.rates(
        [(one, s, 1e8 + 1e6 * one["held_gaussians"]) for one, s in zip(work, seconds, strict=True)]
    )
    assert found.seconds["fitted_gaussians"] == pytest.approx(1e-3, rel=1e-3)
    assert "held_gaussians" not in found.seconds
    assert found.memory_bytes["held_gaussians"] == pytest.approx(1e6, rel=1e-2)


@pytest.fixture
def scene() -> Scene:
    count, generator = 60, torch.Generator().manual_seed(0)
    means = torch.rand(count, 3, generator=generator) * torch.tensor([2.0, 2.0, 1.0])
    still = torch.zeros(3, 5, 3)
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.5, 1.0]),
        moving_index=torch.arange(5),
        offsets=still + torch.tensor([0.0, 0.1, 0.4])[:, None, None],
        rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(3, 5, 4).clone(),
        log_scale_offsets=still,
    )
    gaussians = Gaussians(
        means=means + torch.tensor([-1.0, -1.0, 2.0]),
        quats=torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(count, 4).clone(),
        scales=torch.full((count, 3), 0.05),
        opacities=torch.linspace(0, 1, count),
        sh=torch.rand(count, 4, 3, generator=generator),
    )
    cameras = stack_cameras([pinhole(24.0, (24, 24))] * 8)
    return Scene(
        gaussians=gaussians,
        motion=motion,
        path=CameraPath(cameras=cameras, times_s=torch.linspace(0, 1, 8)),
        provenance=Provenance(generator="test"),
    )


def test_errors_of_a_scene_grow_with_what_is_left_out(scene: Scene) -> None:
    rows = calibration_errors.all_rows(
        [[0.0] * len(calibration_errors.generation_settings())],
        [scene],
        [scene_errors(scene)],
    )
    errors = {
        name: [(dict(row.values), row.error) for row in found] for name, found in rows.items()
    }
    render = {(v["side_share"], v["alpha_cutoff"]): error for v, error in errors["render"]}
    assert render[1.0, 1 / 4096] == 0 < render[1.0, 1 / 64] < render[1.0, 1 / 16]
    assert 0.1 < render[0.75, 1 / 4096] < render[0.5, 1 / 4096] < 2  # shares of the detail
    html = {(v["min_opacity"], v["degree"]): error for v, error in errors["export html"]}
    assert html[0.0, 3] == html[0.0, 1] == 0 < html[0.0, 0]
    assert html[0.05, 3] < html[0.2, 3]
    bake = [error for _, error in errors["bake"]]
    assert bake[0] < 1e-5 and bake == sorted(bake)
