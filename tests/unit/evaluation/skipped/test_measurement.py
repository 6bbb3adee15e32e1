"""Shared work runs once, the fastest run counts, and an interrupted report goes on."""

from pathlib import Path

import pytest
import torch

from diff4splat.evaluation.skipped.measurement import Bench, Item, Measured
from diff4splat.evaluation.skipped.partial_rows import PARTIAL, PartialRows


def test_items_that_share_a_function_share_its_runs() -> None:
    ticks, calls = iter([0.0, 5.0, 10.0, 12.0, 20.0, 21.0, 30.0, 34.0]), []

    def frames(name: str) -> list[torch.Tensor]:
        calls.append(name)
        return [torch.zeros(2, 2, 3)]

    lean, full = (lambda name=name: frames(name) for name in ("lean", "full"))
    bench = Bench("x", repeats=2, clock=lambda: next(ticks))
    first = bench.measure(Item(name="a", full=full, lean=lean, saved_bytes=1))
    second = bench.measure(Item(name="b", full=lean, lean=full, saved_bytes=1))
    assert calls == ["full", "full", "lean", "lean"]
    assert (first.full_s, first.lean_s) == (2.0, 1.0) == (second.lean_s, second.full_s)
    assert first.error == 0


@pytest.fixture
def row() -> Measured:
    return Measured(
        item="a", source="x", full_s=2.0, lean_s=1.0, saved_bytes=5, error=0.0, mean_square=0.0
    )


def test_an_interrupted_report_goes_on(tmp_path: Path, row: Measured) -> None:
    assert PartialRows(tmp_path, {"resolution": 64}).once("x", lambda: [row]) == [row]
    again = PartialRows(tmp_path, {"resolution": 64})
    assert again.once("x", lambda: pytest.fail("measured twice")) == [row]
    assert not PartialRows(tmp_path, {"resolution": 128}).rows
    again.remove()
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["", "[]", '{"key": 1}', "\x00"])
def test_a_damaged_record_counts_as_none(text: str, tmp_path: Path) -> None:
    (tmp_path / PARTIAL).write_text(text)
    assert PartialRows(tmp_path, {}).rows == {}
