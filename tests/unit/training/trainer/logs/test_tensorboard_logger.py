"""Curves are a convenience: whatever becomes of them, training goes on."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from diff4splat.training.trainer.logs.tensorboard_logger import TensorboardLogger


class Full:
    """A writer whose disk fills up after some scalars."""

    def __init__(self, folder: str) -> None:
        self.left = 2

    def add_scalar(self, name: str, value: float, step: int) -> None:
        self.left -= 1
        if self.left < 0:
            raise OSError(28, "No space left on device")


def refuse(folder: str) -> None:
    raise FileExistsError(17, "File exists")


def board(monkeypatch: pytest.MonkeyPatch, writer: object, notes: list[str]) -> TensorboardLogger:
    module = SimpleNamespace(SummaryWriter=writer)
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", module)
    return TensorboardLogger(Path("nowhere"), notes.append)


def test_a_full_disk_ends_the_curves_with_one_note(monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[str] = []
    curves = board(monkeypatch, Full, notes)
    curves.scalars(0, {"a": 1.0, "b": None, "c": 2.0})
    assert notes == []
    curves.scalars(1, {"a": 1.0, "c": 2.0})
    curves.image(1, torch.zeros(2, 2, 3))
    curves.close()
    said = "tensorboard: no more curves (No space left on device); the numbers are in log.jsonl"
    assert notes == [said]


def test_a_folder_that_cannot_be_made_too(monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[str] = []
    board(monkeypatch, refuse, notes).scalars(0, {"a": 1.0})
    assert len(notes) == 1 and "(File exists)" in notes[0]


def without_threads(folder: str) -> None:
    raise RuntimeError("can't start new thread")


def test_a_machine_without_threads_to_spare_too(monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[str] = []
    board(monkeypatch, without_threads, notes).scalars(0, {"a": 1.0})
    assert len(notes) == 1 and "(can't start new thread)" in notes[0]
