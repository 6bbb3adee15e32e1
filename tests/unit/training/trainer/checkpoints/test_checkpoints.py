"""CheckpointStore that are cut off, damaged, foreign or cannot be written."""

import errno
import json
import os
import shutil
from pathlib import Path

import pytest
import safetensors.torch
import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.errors import CheckpointError, FileFormatError, OutputError
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.trainer.checkpoints.files import candidates, checkpoint_name
from diff4splat.training.trainer.checkpoints.store import differences
from diff4splat.training.trainer.checkpoints.tensor_store import (
    _file_numbers,
    read_tensors,
    stored_shapes,
    write_tensors,
)
from diff4splat.training.trainer.loop.fit import fit_stage
from diff4splat.training.trainer.loop.progress import Progress
from diff4splat.training.trainer.settings import StageResult


def train(folder: Path, toy: Toy | None = None, **changes) -> StageResult:
    changes = {"checkpoint_every": 1, "keep_checkpoints": 3} | changes
    return fit_stage(ToyStage(), ToySamples(), (toy or Toy()).recipe(), toy_run(folder, **changes))


@pytest.fixture(scope="module")
def three_steps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that stopped; copy it."""
    folder = tmp_path_factory.mktemp("three")
    train(folder, stop_after_steps=3)
    return folder


@pytest.fixture(scope="module")
def never_stopped(tmp_path_factory: pytest.TempPathFactory) -> StageResult:
    return train(tmp_path_factory.mktemp("six"))


def assert_same_tensors(first: StageResult, second: StageResult) -> None:
    for key, shape in stored_shapes(first.checkpoint).items():
        ours, theirs = {key: torch.empty(shape)}, {key: torch.empty(shape)}
        read_tensors(first.checkpoint, ours)
        read_tensors(second.checkpoint, theirs)
        assert torch.equal(ours[key], theirs[key])


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "checkpoints").iterdir())


def name(step: int, window: int = 0) -> str:
    return checkpoint_name(Progress(step=step, rollbacks=window))


def test_the_newest_few_are_kept_and_latest_names_one(tmp_path) -> None:
    result = train(tmp_path)
    assert names(tmp_path) == ["latest", name(4), name(5), name(6)]
    assert (tmp_path / "checkpoints" / "latest").read_text() == f"{name(6)}\n"
    assert result.checkpoint.name == name(6)


def test_nothing_in_a_checkpoint_is_pickle(tmp_path) -> None:
    result = train(tmp_path)
    assert {path.suffix for path in result.checkpoint.iterdir()} == {".json", ".safetensors"}
    for file in result.checkpoint.glob("*.safetensors"):
        assert safetensors.torch.load_file(file)


def test_frozen_parts_are_not_stored_again(tmp_path) -> None:
    result = train(tmp_path)
    parts = {key.split(".")[1] for key in stored_shapes(result.checkpoint)}
    assert parts == {"body", "head"}


def test_chronological_order_and_what_latest_says(tmp_path) -> None:
    for step, window in ((5, 0), (9, 0), (5, 1)):
        (tmp_path / name(step, window)).mkdir()
    (tmp_path / ".partial-x").mkdir()
    (tmp_path / "notes").mkdir()
    assert candidates(tmp_path) == [name(5, 1), name(9), name(5)]
    (tmp_path / "latest").write_text(name(9) + "\n")
    assert candidates(tmp_path) == [name(9), name(5, 1), name(5)]
    (tmp_path / "latest").write_text("elsewhere\n")
    assert candidates(tmp_path) == [name(5, 1), name(9), name(5)]
    assert candidates(tmp_path / "nothing") == []


def without_state(folder: Path) -> None:
    (folder / "state.json").unlink()


def half_state(folder: Path) -> None:
    text = (folder / "state.json").read_text()
    (folder / "state.json").write_text(text[: len(text) // 2])


def no_tensors(folder: Path) -> None:
    for file in folder.glob("*.safetensors"):
        file.unlink()


def cut_tensors(folder: Path) -> None:
    (file,) = folder.glob("*.safetensors")
    file.write_bytes(file.read_bytes()[:-7])


def one_bit(folder: Path) -> None:
    (file,) = folder.glob("*.safetensors")
    data = bytearray(file.read_bytes())
    data[-5] ^= 1
    file.write_bytes(data)


def newer_version(folder: Path) -> None:
    state = json.loads((folder / "state.json").read_text())
    (folder / "state.json").write_text(json.dumps(state | {"version": 3}))


def unknown_keys(folder: Path) -> None:
    state = json.loads((folder / "state.json").read_text())
    state["progress"]["colour"] = "red"
    (folder / "state.json").write_text(json.dumps(state))


DAMAGES = (
    without_state,
    half_state,
    no_tensors,
    cut_tensors,
    one_bit,
    newer_version,
    unknown_keys,
)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_checkpoint_is_passed_over_with_a_notice(
    tmp_path, three_steps, never_stopped, damage
) -> None:
    shutil.copytree(three_steps, tmp_path / "hurt")
    damage(tmp_path / "hurt" / "checkpoints" / name(3))
    notes: list[str] = []
    hurt = train(tmp_path / "hurt", note=notes.append)
    said = [text for text in notes if "the checkpoint before it is taken" in text]
    assert len(said) == 1
    assert name(3) in said[0]
    assert "toy: resumed at step 2" in notes
    assert hurt.step == never_stopped.step == 6
    assert_same_tensors(never_stopped, hurt)


def test_a_run_without_any_whole_checkpoint_begins_again(tmp_path) -> None:
    train(tmp_path, stop_after_steps=1)
    without_state(tmp_path / "checkpoints" / name(1))
    notes: list[str] = []
    assert train(tmp_path, note=notes.append).step == 6
    assert not any("resumed" in text for text in notes)


def test_leftovers_of_a_killed_writer_are_cleared(tmp_path) -> None:
    leftover = tmp_path / "checkpoints" / f".partial-{name(1)}"
    leftover.mkdir(parents=True)
    (leftover / "shard.safetensors").write_bytes(b"half")
    train(tmp_path)
    assert names(tmp_path) == ["latest", name(4), name(5), name(6)]


def test_another_configuration_is_refused_with_what_differs(tmp_path) -> None:
    train(tmp_path, stop_after_steps=1)
    toy = Toy(optimizer=OptimizerSettings(learning_rate=0.5, warmup_steps=2), global_batch=8)
    with pytest.raises(CheckpointError) as caught:
        train(tmp_path, toy, fingerprint="g")
    said = str(caught.value)
    assert "fingerprint g, got stage toy with f" in said
    assert "global_batch: 4 became 8" in said
    assert "optimizer.learning_rate: 0.01 became 0.5" in said
    with pytest.raises(CheckpointError, match="model, seed or data differ"):
        train(tmp_path, fingerprint="g")
    with pytest.raises(CheckpointError, match=r"of stage other .* got stage toy"):
        train(tmp_path, Toy(name="other"))


def test_differences_look_into_nested_settings_and_missing_keys() -> None:
    assert differences({"a": {"b": 1, "c": 2}, "d": 3}, {"a": {"b": 1, "c": 4}}) == [
        "a.c: 2 became 4",
        "d: 3 became None",
    ]


def test_another_network_is_refused(tmp_path) -> None:
    train(tmp_path, stop_after_steps=1)
    stage = ToyStage()
    stage.head = torch.nn.Linear(5, 2, bias=False)
    with pytest.raises(CheckpointError, match="belongs to another configuration"):
        stage.head = torch.nn.Sequential(stage.head)
        fit_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path))
    stage = ToyStage()
    stage.head = torch.nn.Linear(5, 3)
    with pytest.raises(CheckpointError, match=r"of another shape .*\(2, 5\) instead of \(3, 5\)"):
        fit_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path))


def full_disk(*args: object, **kwargs: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("place", ["safetensors.torch.save", "os.fsync", "os.replace"])
def test_a_full_disk_leaves_the_checkpoints_before(
    tmp_path, monkeypatch, never_stopped, place: str
) -> None:
    train(tmp_path / "full", stop_after_steps=2)
    before = names(tmp_path / "full")
    with monkeypatch.context() as patch:
        patch.setattr(place, full_disk)
        with pytest.raises(OutputError, match="the disk is full"):
            train(tmp_path / "full", stop_after_steps=1)
    assert names(tmp_path / "full") == before
    assert_same_tensors(never_stopped, train(tmp_path / "full"))


def test_a_file_in_the_way_is_named(tmp_path) -> None:
    (tmp_path / "checkpoints").write_text("")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        train(tmp_path)


def test_tensors_of_any_kind_survive(tmp_path) -> None:
    tensors = {
        "scalar": torch.tensor(3.5),
        "empty": torch.zeros(0, 4),
        "whole": torch.arange(6).reshape(2, 3),
        "half": torch.randn(3).to(torch.bfloat16),
        "turned": torch.randn(4, 5).t(),
        "strided": torch.randn(2, 3, 4, 5).to(memory_format=torch.channels_last),
    }
    tensors["tied"] = tensors["half"]
    write_tensors(tmp_path, tensors)
    found = {key: torch.zeros_like(value) for key, value in tensors.items()}
    read_tensors(tmp_path, found)
    for key, value in tensors.items():
        assert torch.equal(found[key], value), key


def test_large_checkpoints_are_split_over_files_of_about_one_gibibyte() -> None:
    meta = {str(i): torch.empty(1 << 27, device="meta") for i in range(6)}
    assert list(_file_numbers(meta).values()) == [1, 1, 2, 2, 3, 3]
    huge = {"a": torch.empty(1 << 30, device="meta"), "b": torch.empty(1, device="meta")}
    assert list(_file_numbers(huge).values()) == [1, 2]


def test_files_that_are_no_shards_are_named(tmp_path) -> None:
    (tmp_path / "shard-1.safetensors").write_bytes(b"nothing of the kind")
    with pytest.raises(FileFormatError, match="expected whole shards"):
        stored_shapes(tmp_path)


def test_resuming_a_run_gives_back_its_weights(tmp_path) -> None:
    stage = ToyStage()
    fit_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path, stop_after_steps=2))
    again = ToyStage(seed=9)
    again.eyes = stage.eyes
    fit_stage(again, ToySamples(), Toy().recipe(), toy_run(tmp_path, stop_after_steps=4))
    fit_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path))
    for key, value in weights(stage).items():
        if not key.startswith("unused"):
            assert torch.equal(value, weights(again)[key]), key
