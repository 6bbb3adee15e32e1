"""A worker that misbehaves costs its own cell and nothing else."""

import math
import mmap
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from loading import BUILT_IN, Peer
from records import timing
from scenes import TINY
from timing import interleaved, machine
from timing.interleaved import Effort, Turn
from timing.machine import Disturbance
from workers import memory
from workers.process import Limits, Worker, WorkerFailure, explain
from workers.render_worker import GroundTruthWorker, RenderWorker

LIMITS = Limits(threads=1, memory_bytes=4 << 30, answer_s=600.0)
EFFORT = Effort(seconds=0.05, patience_s=100.0, memory_bytes=4 << 30, window_s=0.001)
UNRULY = """
import os
import sys
import time

import torch

NAME = "unruly"
CALLS = []


class Prepared:
    def forward(self):
        CALLS.append(0)
        if len(CALLS) == 2:
            return torch.zeros(1 << 50)
        if len(CALLS) == 3:
            raise ValueError("first line\\nsecond line")
        if len(CALLS) == 4:
            print("the last words")
            sys.stdout.flush()
            os.abort()
        return torch.zeros(32, 32, 3)

    def forward_backward(self, grad_rgb):
        return None


def unavailable():
    return None


def prepare(gaussians, camera):
    return Prepared()
"""


def test_failures_become_reasons_and_the_worker_lives_until_it_dies(tmp_path: Path) -> None:
    file = tmp_path / "unruly.py"
    file.write_text(UNRULY)
    with Worker(RenderWorker, LIMITS) as worker:
        assert worker.ask("load", file) == ("", True)
        # The warm-up is the first call.
        assert worker.ask("prepare", TINY[0]) is None
        assert worker.ask("first", "both") is None
        with pytest.raises(WorkerFailure, match=r"out of memory \(limit 4.0 GiB\)"):
            worker.ask("first", "forward")
        with pytest.raises(WorkerFailure, match="ValueError: first line second line"):
            worker.ask("first", "forward")
        with pytest.raises(WorkerFailure, match=r"died \(SIGABRT\).*the last words"):
            worker.ask("first", "forward")
        with pytest.raises(WorkerFailure):
            worker.ask("first", "forward")


def test_a_worker_that_does_not_answer_is_stopped() -> None:
    limits = Limits(threads=1, memory_bytes=4 << 30, answer_s=0.01)
    with (
        Worker(GroundTruthWorker, limits) as worker,
        pytest.raises(WorkerFailure, match="no answer"),
    ):
        worker.ask("find", TINY[0], Path("unused"), False)


@pytest.mark.slow
def test_one_renderer_is_measured_and_checked(tmp_path: Path) -> None:
    peer = Peer(name="tile-loop", file=BUILT_IN / "tile_loop.py")
    said = []
    subject = interleaved.find_subject(TINY[0], tmp_path, EFFORT)
    (cell,) = interleaved.measure(subject, [peer], 1, EFFORT, said.append)
    assert (cell.reason, cell.peer, cell.threads) == ("", "tile-loop", 1)
    assert cell.forward.windows >= 1
    assert cell.forward.best_s <= cell.forward.median_s
    assert cell.image.psnr_db > 60
    assert len(cell.gradients) == 5
    assert subject.work.blended_pairs > 0
    assert said[:2] == ["tiny: tile-loop", "tiny: tile-loop, round 1"]


@pytest.mark.slow
def test_a_truth_that_fails_is_said_and_not_compared(tmp_path: Path) -> None:
    nowhere = tmp_path / "missing" / "folder"
    subject = interleaved.find_subject(TINY[0], nowhere, EFFORT)
    assert subject.truth_file is None
    assert subject.work.reason.startswith("truth: RuntimeError: ")
    assert "missing" in subject.work.reason


def test_patience_bounds_an_answer() -> None:
    assert EFFORT.limits(2).answer_s == 4 * EFFORT.patience_s
    assert EFFORT.truth_limits().answer_s > EFFORT.limits(2).answer_s


@pytest.mark.parametrize(("own_s", "cores"), [(1.0, 1.5), (4.0, 0.0), (4.1, 0.0)])
def test_other_programs_are_told_from_our_own(
    own_s: float, cores: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert machine._busy_s() >= 0.0 and machine._own_s() > 0.0
    for name, readings in {"_busy_s": (7.0, 11.0), "_own_s": (2.0, 2.0 + own_s)}.items():
        monkeypatch.setattr(machine, name, iter(readings).__next__)
    monkeypatch.setattr(machine, "time", SimpleNamespace(monotonic=iter((3.0, 5.0)).__next__))
    assert Disturbance().cores() == pytest.approx(cores)


def test_explanations_are_one_short_line() -> None:
    assert explain(MemoryError(), 1 << 30) == "out of memory (limit 1.0 GiB)"
    assert "std::bad_alloc" not in explain(RuntimeError("std::bad_alloc"), 1 << 30)
    long = explain(RuntimeError("x\n" * 500), 1)
    assert "\n" not in long
    assert len(long) <= 160


def test_the_peak_can_be_set_back() -> None:
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("needs Linux")
    before = memory.reset_peak()
    # Straight from the system: an allocator may have room that counts already.
    with mmap.mmap(-1, 64 << 20) as block:
        for page in range(0, len(block), mmap.PAGESIZE):
            block[page] = 1
    grown = memory.peak_bytes() - before
    assert 60 << 20 < grown < 100 << 20
    assert memory.peak_bytes() - memory.reset_peak() > 60 << 20
    assert memory.available_bytes() > 0


class Scripted:
    """A worker that answers from a list of window seconds, and writes down what it was asked."""

    def __init__(self, log: list, name: str, window_s: float = 0.01, fail_at: int = -1) -> None:
        self.log, self.name, self.window_s, self.fail_at, self.asked = (
            log,
            name,
            window_s,
            fail_at,
            0,
        )

    def ask(self, method: str, *arguments: object) -> object:
        if method == "window":
            self.asked += 1
            if self.asked == self.fail_at:
                raise WorkerFailure("died (SIGABRT)")
            self.log.append((self.name, arguments[0]))
            return self.window_s
        return {"load": ("a note", False), "prepare": None, "first": (self.window_s, 5)}[method]

    def close(self) -> None:
        pass


def scripted(monkeypatch: pytest.MonkeyPatch, workers: list) -> list[Turn]:
    queue = iter(workers)
    monkeypatch.setattr(interleaved, "Worker", lambda *_: next(queue))
    effort = Effort(seconds=0.1, patience_s=1.0, memory_bytes=1, window_s=0.02)
    turns = [
        Turn(peer=Peer(name=w.name, file=Path()), scene=TINY[0], threads=1, effort=effort)
        for w in workers
    ]
    for turn in turns:
        turn.begin(None)
    while any(turn.unfinished for turn in turns):
        for turn in turns:
            if turn.unfinished:
                turn.round()
    return turns


def test_windows_of_all_renderers_interleave(monkeypatch: pytest.MonkeyPatch) -> None:
    log: list = []
    turns = scripted(monkeypatch, [Scripted(log, "a"), Scripted(log, "b", window_s=0.2)])
    assert log[:4] == [("a", "forward"), ("a", "both"), ("b", "forward"), ("b", "both")]
    # Two windows of at least 0.02 s a round: three rounds until 0.1 s are used up.
    assert [name for name, _ in log].count("a") == 6
    assert [name for name, _ in log].count("b") == 2
    cell = turns[0].cell(0.0)
    assert (cell.note, cell.judged, cell.forward.windows, cell.forward.peak_bytes) == (
        "a note",
        False,
        3,
        5,
    )


def test_the_impatient_measure_once(monkeypatch: pytest.MonkeyPatch) -> None:
    log: list = []
    (turn,) = scripted(monkeypatch, [Scripted(log, "slow", window_s=2.0)])
    assert log == []
    assert turn.cell(0.0).forward.best_s == 2.0
    assert turn.cell(0.0).forward.windows == 1


def test_a_death_in_the_rounds_keeps_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    log: list = []
    (turn,) = scripted(monkeypatch, [Scripted(log, "mortal", fail_at=4)])
    cell = turn.cell(0.0)
    assert cell.reason == "backward: died (SIGABRT)"
    assert cell.both.windows == 1
    assert cell.forward.windows > 1


def test_the_first_reason_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(Scripted):
        def ask(self, method: str, *arguments: object) -> object:
            if method == "first":
                raise WorkerFailure(f"cannot do {arguments[0]}")
            return super().ask(method, *arguments)

    (turn,) = scripted(monkeypatch, [Failing([], "failing")])
    assert turn.cell(0.0).reason == "forward: cannot do forward"
    assert turn.cell(0.0).forward is turn.cell(0.0).both is None


class Slow:
    """A renderer whose pictures take ten milliseconds of its clock, and 64 MiB."""

    def __init__(self) -> None:
        self.calls = 0

    def perf_counter(self) -> float:
        return 0.01 * self.calls

    def forward(self) -> torch.Tensor:
        self.calls += 1
        # Fresh pages of the kernel: memory that was freed before would not count.
        return torch.frombuffer(mmap.mmap(-1, 64 << 20), dtype=torch.float32).fill_(1)

    def forward_backward(self, grad_rgb: torch.Tensor) -> None:
        return None


def test_a_window_gives_seconds_per_call_and_a_first_call_its_growth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station, slow = RenderWorker(), Slow()
    station._prepared, station._grad_rgb = slow, torch.ones(1)
    monkeypatch.setattr("workers.render_worker.time", slow)
    assert station.window("forward", 0.0) == pytest.approx(0.01)
    before = slow.calls
    assert station.window("forward", 0.195) == pytest.approx(0.01)
    assert slow.calls - before == 20
    seconds, growth = station.first("forward")
    assert seconds == pytest.approx(0.01)
    assert 50 << 20 < growth < 100 << 20
    assert station.first("both") is None


def test_the_first_call_stands_in_for_missing_windows() -> None:
    assert timing([], 3.0, 7).best_s == 3.0
    found = timing([0.3, 0.1, 0.2], 3.0, 7)
    assert (found.best_s, found.median_s, found.windows, found.first_s) == (0.1, 0.2, 3, 3.0)
    assert math.isfinite(found.best_s)
