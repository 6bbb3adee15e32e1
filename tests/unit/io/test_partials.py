"""Other processes: partials of dead runs go, those of living runs stay, one name has one writer."""

import os
from pathlib import Path

import pytest
from other_writer import kill, other_process
from toy_training import Toy, ToySamples, ToyStage, toy_run

from diff4splat.cli.main import run
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import OutputError
from diff4splat.io.atomic import atomic_folder, atomic_path, write_text
from diff4splat.io.locks import sole_writer
from diff4splat.io.partials import Partial, remove_abandoned
from diff4splat.training.trainer.loop.fit import fit_stage

OPTIONS = ShardOptions(generator="test 1")


def test_a_killed_writer_of_a_file_leaves_what_the_next_one_removes(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with other_process("file", target) as other:
        kill(other)
    assert len(list(tmp_path.iterdir())) > 0
    write_text(target, "ours")
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
    assert target.read_text() == "ours"


def test_a_killed_writer_of_a_folder_hands_nothing_to_the_next(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with other_process("folder", out) as other:
        kill(other)
    with atomic_folder(out) as staging:
        assert list(staging.iterdir()) == []
        (staging / "b.txt").write_text("ours")
    assert [file.name for file in out.iterdir()] == ["b.txt"]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_the_second_process_is_refused_and_the_first_one_finishes(
    kind: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    make = atomic_path if kind == "file" else atomic_folder
    with other_process(kind, out) as other:
        message = f"{out}: expected to be the only writer, but another process is writing there"
        with pytest.raises(OutputError, match=message), make(out):
            pytest.fail("entered")
        write_text(tmp_path / "neighbour.txt", "sweeps, and leaves the living alone")
        other.communicate("\n")
        assert other.returncode == 0
    assert (out if kind == "file" else out / "a.txt").read_text() == "theirs"
    assert {file.name for file in tmp_path.iterdir()} == {"out", "neighbour.txt"}
    with make(out) as temporary:
        (temporary if kind == "file" else temporary / "a.txt").write_text("ours")
    assert (out if kind == "file" else out / "a.txt").read_text() == "ours"


def test_process_numbers_play_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In two containers both processes are number 1."""
    monkeypatch.setattr(os, "getpid", lambda: 1)
    stale = tmp_path / ".partial-1-0"
    stale.mkdir()
    (stale / "depth.exr").write_text("of another run")
    with atomic_folder(tmp_path) as staging:
        (staging / "a.txt").write_text("x")
    assert not (tmp_path / "depth.exr").exists()


def test_one_process_may_nest_and_an_empty_folder_goes_again(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with sole_writer(out), sole_writer(out), atomic_folder(out):
        pass
    assert not out.exists()


def test_partials_are_removed_only_when_nobody_holds_them(tmp_path: Path) -> None:
    mine = Partial(tmp_path)
    (tmp_path / ".partial-kept").mkdir()
    remove_abandoned(tmp_path)
    assert mine.folder.is_dir()
    mine.discard()
    mine.discard()
    assert [file.name for file in tmp_path.iterdir()] == [".partial-kept"]


def test_without_locks_everything_is_written_and_nothing_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(38, "Function not implemented")

    abandoned = Partial(tmp_path)
    monkeypatch.setattr("fcntl.flock", refuse)
    with atomic_folder(tmp_path) as staging:
        write_text(staging / "a.txt", "x")
    assert {file.name for file in tmp_path.iterdir()} == {"a.txt", abandoned.folder.name}


def test_a_killed_shard_writer_is_cleaned_up_after(tmp_path: Path) -> None:
    with other_process("folder", tmp_path) as other:
        with pytest.raises(OutputError, match="only writer"), ShardWriter(tmp_path, OPTIONS):
            pytest.fail("entered")
        kill(other)
    with ShardWriter(tmp_path, OPTIONS, append=True):
        assert list(tmp_path.iterdir()) == []


def test_a_stage_of_training_has_one_run(tmp_path: Path) -> None:
    command = (ToyStage(), ToySamples(), Toy().recipe(), toy_run(tmp_path, checkpoint_every=2))
    with (
        other_process("folder", tmp_path),
        pytest.raises(OutputError, match=f"{tmp_path}: expected to be the only writer"),
    ):
        fit_stage(*command)
    assert fit_stage(*command).outcome == "finished"


def test_a_fit_refuses_before_it_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "data").mkdir()
    command = ["fit", str(tmp_path / "data"), "--out", str(tmp_path / "out"), "--restart"]
    with other_process("folder", tmp_path / "out"):
        assert run(command) == 2
        assert "another process is writing there" in capsys.readouterr().err
