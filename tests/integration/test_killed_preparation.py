"""Preparation that is killed at any point and started again ends in the bytes of one run."""

import random
from pathlib import Path

import pytest
from killed_step import changes_of
from several_sequences import write_sequences, write_settings

from diff4splat.cli.main import run

CAPTIONS = '[captions]\ncaptions = "captions.json"'
SEED = 20


def results(work: Path) -> dict[str, bytes]:
    """Shards, indices, manifests and scores; reports say what one run did."""
    files = [file for file in work.rglob("*") if file.is_file() and file.suffix != ".csv"]
    assert not list(work.rglob(".partial-*")), "nothing half written stays"
    return {str(file.relative_to(work)): file.read_bytes() for file in files}


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("source")
    return write_sequences(folder / "copy", 4, damaged=(2,))


def settings(folder: Path, copy: Path) -> str:
    folder.mkdir()
    (folder / "copy").symlink_to(copy)
    (folder / "captions.json").write_text("{}")
    return str(write_settings(folder, 1, CAPTIONS))


def assert_killed_anywhere(copy: Path, folder: Path, points: list[float]) -> None:
    whole = settings(folder / "whole", copy)
    changes = changes_of(["prepare", "pipeline", whole, "--task", "0"])
    wanted = results(folder / "whole" / "work")
    for number, share in enumerate(points):
        name = folder / f"killed-{number}"
        command = ["prepare", "pipeline", settings(name, copy), "--task", "0"]
        kill_at = 1 + int(share * (changes - 1))
        assert changes_of(command, kill_at) is None
        assert run(command) == 0
        assert results(name / "work") == wanted, f"killed before change {kill_at} of {changes}"


def test_a_task_that_is_killed_at_random_points(copy: Path, tmp_path: Path) -> None:
    drawn = random.Random(SEED)
    assert_killed_anywhere(copy, tmp_path, [drawn.random() for _ in range(4)])


@pytest.mark.slow
def test_a_task_that_is_killed_before_every_change(copy: Path, tmp_path: Path) -> None:
    assert_killed_anywhere(copy, tmp_path, [number / 60 for number in range(61)])


def test_parts_of_an_import_are_killed_and_finished(copy: Path, tmp_path: Path) -> None:
    for task in "01":
        command = ["prepare", "import", str(copy), "--dataset", "realestate10k", "--append"]
        command += ["--task", task, "--tasks", "2", "--out"]
        changes = changes_of([*command, str(tmp_path / "whole" / task)])
        killed = [*command, str(tmp_path / "killed" / task)]
        assert changes_of(killed, changes * 2 // 3) is None
        assert changes_of(killed, changes // 2) is None, "and again"
        assert run(killed) == 0
    found, wanted = results(tmp_path / "killed"), results(tmp_path / "whole")
    assert {n: b for n, b in found.items() if n.endswith((".tar", ".json"))} == {
        n: b for n, b in wanted.items() if n.endswith((".tar", ".json"))
    }
