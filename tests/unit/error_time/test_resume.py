"""A report that was stopped goes on, and ``quick`` runs on fewer inputs."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from diff4splat.error_time import report as error_time
from diff4splat.error_time.declared import ALL_INPUTS, FEW_INPUTS
from diff4splat.error_time.knobs import ApproximationSetting, KnobRegistry
from diff4splat.error_time.resume import PARTIAL, PartialReport
from diff4splat.error_time.sweep import sweep
from diff4splat.progress.machine import this_machine


class StoppedError(Exception):
    """What ends the first report."""


class Runs:
    """Two settings whose runs are counted; ``stop_at`` ends the program there."""

    def __init__(self, stop_at: str | None = None) -> None:
        self.ran, self.stop_at = [], stop_at

    def registry(self, settings: tuple[int, ...] = (1, 2)) -> KnobRegistry:
        registry = KnobRegistry()
        for name in ("first", "second"):
            registry.register(self.knob(name, settings))
        return registry

    def knob(self, name: str, settings: tuple[int, ...]) -> ApproximationSetting:
        def run(value: int) -> torch.Tensor:
            if name == self.stop_at:
                raise StoppedError
            self.ran.append((name, value))
            return torch.tensor(1.0 / value)

        return ApproximationSetting(
            name=name,
            summary="a sum",
            error_unit="absolute error",
            settings=settings,
            default=settings[0],
            reference=9,
            run=run,
            error=lambda result, reference: float((result - reference).abs()),
            repeats=0,
        )


def stopped(folder: Path, **options: object) -> None:
    with pytest.raises(StoppedError):
        error_time.run(folder, registry=Runs(stop_at="second").registry(), **options)
    assert (folder / PARTIAL).is_file()


def test_a_stopped_report_goes_on_after_the_last_complete_knob(tmp_path: Path) -> None:
    stopped(tmp_path)
    again = Runs()
    written = error_time.run(tmp_path, registry=again.registry())
    assert {name for name, _ in again.ran} == {"second"}
    whole = error_time.run(tmp_path / "whole", registry=Runs().registry())
    errors = [[row.error for one in made.results for row in one.rows] for made in (written, whole)]
    assert errors[0] == errors[1]
    assert not (tmp_path / PARTIAL).exists()


def test_only_values_that_are_new_run_again(tmp_path: Path) -> None:
    stopped(tmp_path)
    again = Runs()
    error_time.run(tmp_path, registry=again.registry(settings=(1, 2, 4)))
    # The reference, and the value that the stopped report did not have.
    assert [value for name, value in again.ran if name == "first"] == [9, 4]


@pytest.mark.parametrize("options", [{"repeats": 5}, {"quick": True}])
def test_rows_of_another_kind_of_run_do_not_count(tmp_path: Path, options: dict) -> None:
    stopped(tmp_path)
    again = Runs()
    error_time.run(tmp_path, registry=again.registry(), **options)
    assert {name for name, _ in again.ran} == {"first", "second"}


def test_rows_of_another_machine_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped(tmp_path)
    other = replace(this_machine(), threads=99)
    monkeypatch.setattr("diff4splat.error_time.resume.this_machine", lambda: other)
    assert PartialReport(tmp_path, {"repeats": 3, "quick": False}).rows == {}


@pytest.mark.parametrize(
    "damaged", ["", "{", "[]", '{"key": 1}', "\x00\xff", '{"rows": {"first": 3}, "key": null}']
)
def test_a_damaged_note_is_worth_no_more_than_none(tmp_path: Path, damaged: str) -> None:
    (tmp_path / PARTIAL).write_text(damaged)
    again = Runs()
    error_time.run(tmp_path, registry=again.registry())
    assert len(again.ran) == 6


@pytest.mark.parametrize("row", [{}, {"seconds": 1}, {"nonsense": 1}, 3])
def test_a_row_with_wrong_members_is_measured_again(tmp_path: Path, row: object) -> None:
    stopped(tmp_path)
    record = json.loads((tmp_path / PARTIAL).read_text())
    record["rows"]["first"]["1"] = row
    (tmp_path / PARTIAL).write_text(json.dumps(record))
    again = Runs()
    error_time.run(tmp_path, registry=again.registry())
    assert ("first", 1) in again.ran
    assert ("first", 2) not in again.ran


def test_infinite_errors_survive(tmp_path: Path) -> None:
    lost = replace(Runs().knob("lost", (1, 2)), error=lambda *results: float("nan"))
    note = PartialReport(tmp_path, {})
    note.add(sweep(lost))
    assert PartialReport(tmp_path, {}).known(lost)[1].error == float("inf")


def test_quick_runs_on_a_photograph_and_a_world(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def register(registry: KnobRegistry, inputs: tuple[int, ...]) -> None:
        seen.append(inputs)
        registry.register(Runs().knob("only", (1, 2)))

    monkeypatch.setattr(error_time, "register_known_knobs", register)
    for quick in (True, False):
        error_time.run(tmp_path, quick=quick)
    assert seen == [FEW_INPUTS, ALL_INPUTS]
    assert len(FEW_INPUTS) == 2
