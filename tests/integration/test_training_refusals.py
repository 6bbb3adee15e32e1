"""What the training commands refuse, pass over or survive, in words for people."""

import json
import os
import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from clip_shards import changes, reading, write_shards
from training_commands import (
    DRAWN,
    SAVING,
    contents,
    refusal,
    rows,
    train,
)

from diff4splat.cli.main import run
from diff4splat.errors import ConfigError
from diff4splat.training.trainer.loading.sampler import plan_batches

Spoil = Callable[[Path], object]


def cut_off(folder: Path) -> None:
    content = (folder / "shard-00000.tar").read_bytes()
    (folder / "shard-00000.tar").write_bytes(content[: len(content) // 2])


def lost(folder: Path) -> None:
    (folder / "shard-00000.tar").unlink()


def no_manifest(folder: Path) -> None:
    (folder / "manifest.json").unlink()


def scrambled(folder: Path) -> None:
    content = bytearray((folder / "shard-00000.tar").read_bytes())
    for place in range(1500, len(content), 1000):
        content[place] ^= 0x10
    (folder / "shard-00000.tar").write_bytes(content)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (cut_off, ("shard-00000.tar", "copy it again")),
        (lost, ("shard-00000.tar", "copy it again")),
        (no_manifest, ("manifest.json", "check the path")),
        (scrambled, ("10 tries", "with checksum", "shard-00000.tar: clip 'clip-")),
    ],
)
def test_broken_shards(
    spoil: Spoil,
    words: tuple[str, ...],
    shards: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder, out = tmp_path / "shards", tmp_path / "run"
    shutil.copytree(shards, folder)
    spoil(folder)
    before = contents(folder)
    assert train("vae", folder, out) == 2
    line = refusal(capsys)
    assert all(word in line for word in words), line
    assert contents(folder) == before
    assert run(["prepare", "check", "--folder", str(folder)]) == 2
    refusal(capsys)


def test_a_clip_without_depth_is_skipped_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_shards(tmp_path / "shards", still=5, moving=6, blind=(0, 1, 2, 5, 6))
    out = tmp_path / "run"
    assert train("vae", folder, out, steps=4) == 0
    replaced = rows(out / "vae", "replaced_sample")
    assert replaced
    assert "expected depth in at least 1%" in replaced[0]["why"]
    assert "leave the clip out" in replaced[0]["why"]
    (state,) = out.glob("vae/checkpoints/*/state.json")
    counted = json.loads(state.read_text())["progress"]["replaced"]
    assert sum(counted.values()) == len(replaced)


def test_clips_that_all_lack_depth_end_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_shards(tmp_path / "shards", still=3, moving=3, blind=range(6))
    assert train("vae", folder, tmp_path / "run") == 2
    line = refusal(capsys)
    assert "10 × InputError: expected depth in at least 1%" in line
    assert "clip-" in line


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--stage", "vea"), ("--stage", "vae, static-low", "'vea'")),
        (("--config", "large"), ("--config", "test, small, paper", "'large'")),
        (("--config", "gone.json"), ("gone.json", "check the path")),
        (("--set", "stages.vae.stepz=1"), ("stages.vae.stepz", "steps")),
        (("--set", "stages.vea.steps=1"), ("stages.vea", "static-low")),
        (("--set", "steps"), ("key=value", "'steps'")),
        (("--set", "stages.vae.data.sources=[]"), ("data.sources", "correct the recipe")),
        (("--set", "trainer.checkpoint_every=0"), ("trainer.checkpoint_every", "at least 1")),
        (("--set", "trainer.evaluate_every=0"), ("trainer.evaluate_every", "at least 1")),
        (("--set", "stages.vae.data.workers=-1"), ("data.workers", "at least 0")),
        (("--set", "stages.vae.data.tracks=-1"), ("data.tracks", "at least 0")),
        (("--set", "stages.vae.data.views=0"), ("data.views", "at least 1")),
        (("--set", "stages.vae.data.size_px=[0,0]"), ("data.size_px", "at least 8")),
        (("--set", "stages.vae.data.frames=4"), ("1 + 4 k",)),
        (("--set", "stages.vae.data.frames=9"), ("at least 9 frames, got 5",)),
        (("--set", "stages.vae.optimizer.learning_rate=NaN"), ("learning_rate", "got nan")),
        (("--set", "stages.vae.optimizer.betas=[2,2]"), ("betas", "(2.0, 2.0)")),
        (("--set", "stages.vae.global_batch=3", "stages.vae.micro_batch=2"), ("micro batch",)),
        (("--set", 'stages.vae.trained=["dit"]'), ("trained parts among vae", "dit")),
        (("--steps", "0"), ("--steps", "more than 0, got 0")),
        (("--steps", "-3"), ("--steps", "got -3")),
        (("--minutes", "nan"), ("--minutes", "got nan")),
        (("--device", "gpu"), ("device", "cpu", "'gpu'")),
        (("--features", "vgg:gone.pth"), ("gone.pth", "check the path")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else str(value),
)
def test_bad_options(
    given: tuple[str, ...],
    words: tuple[str, ...],
    shards: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "run"
    options = {"--config": "test", "--stage": "vae", "--out": str(out)}
    flags = [part for pair in options.items() if pair[0] not in given for part in pair]
    assert run(["train", *flags, "--set", *changes("vae", shards), *given]) == 2
    line = refusal(capsys)
    assert all(word in line for word in words), line
    assert not list(out.rglob("checkpoints/*"))


@pytest.mark.parametrize("text", ["", "{", "[]", '{"name": "test"}', "[" * 5000])
def test_a_damaged_recipe_is_named(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.json").write_text(text)
    recipe = ["--config", str(tmp_path / "mine.json"), "--stage", "vae"]
    assert run(["train", *recipe, "--out", str(tmp_path / "run")]) == 2
    assert "mine.json" in refusal(capsys)
    assert not (tmp_path / "run").exists()


def test_another_configuration_is_refused_and_nothing_touched(
    course: Path, shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(course / "vae", tmp_path / "vae")
    before = contents(tmp_path)
    assert train("vae", shards, tmp_path, steps=3) == 2
    line = refusal(capsys)
    assert "steps: 2 became 3" in line and "choose another folder" in line
    after = contents(tmp_path)
    assert {file: after[file] for file in before} == before


def test_a_full_disk_keeps_what_is_there(
    shards: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "run"
    assert train("vae", shards, out, *SAVING, "--steps", "2", steps=6) == 0
    before = contents(out)
    capsys.readouterr()

    def full(source: object, target: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("diff4splat.training.trainer.checkpoints.store.os.replace", full)
    assert train("vae", shards, out, *SAVING, steps=6) == 2
    assert "the disk is full; free some space" in refusal(capsys)
    monkeypatch.undo()
    kept = [file for file in before if "checkpoints" in str(file)]
    assert kept and all(file.read_bytes() == before[file] for file in kept)
    assert not list(out.rglob(".partial*"))
    assert train("vae", shards, out, *SAVING, steps=6) == 0


@contextmanager
def small_files(limit: int) -> Iterator[None]:
    """Like a disk that is nearly full: no file may grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_no_room_for_a_recipe_or_a_checkpoint(
    shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_files(3000):
        assert train("vae", shards, tmp_path / "recipe") == 2
    assert "recipe.json: expected to write here, but" in refusal(capsys)
    with small_files(100_000):
        assert train("vae", shards, tmp_path / "weights") == 2
    line = refusal(capsys)
    assert "window-000-step-00000002: expected to write here, but" in line
    assert ".partial" not in line
    assert not list(tmp_path.rglob(".partial*"))


def test_no_room_for_a_shard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "clips"
    with small_files(20_000):
        assert run(["prepare", "synth", "--out", str(out), "--clips", "2", *DRAWN]) == 2
    assert "clips: expected to write here, but" in refusal(capsys)
    assert not any(file.is_file() for file in out.rglob("*"))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--clips", "0"), ("--clips", "got 0")),
        (("--workers", "0"), ("--workers", "at least 1", "got 0")),
        (("--size", "3"), ("size", "8 to 4096", "got 3")),
        (("--frames", "0"), ("frames", "1 to 1000", "got 0")),
        (("--views", "0"), ("views", "1 to 8", "got 0")),
        (("--tracks", "-1"), ("tracks", "at least 0", "got -1")),
        (("--still-share", "2"), ("--still-share", "0 to 1", "got 2")),
    ],
    ids=" ".join,
)
def test_worlds_that_cannot_be_drawn(
    given: tuple[str, ...],
    words: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    flags = ["--out", str(tmp_path / "clips"), *(() if "--clips" in given else ("--clips", "1"))]
    assert run(["prepare", "synth", *flags, *given]) == 2
    line = refusal(capsys)
    assert all(word in line for word in words), line
    assert not (tmp_path / "clips").exists()


@pytest.mark.parametrize("most", ["0", "-2"])
def test_checking_no_clip_is_refused(
    most: str, shards: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["prepare", "check", "--folder", str(shards), "--most", most]) == 2
    assert f"--most: expected at least 1, got {most}" in refusal(capsys)


def test_a_launcher_needs_a_recipe_for_several_processes(
    shards: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("WORLD_SIZE", "2")
    assert train("vae", shards, tmp_path) == 2
    assert "parallel: expected ddp or fsdp2 for 2 processes" in refusal(capsys)
    vae = reading(shards).stage("vae")
    with pytest.raises(ConfigError, match="a multiple of 3 processes times micro batch 1, got 2"):
        plan_batches(vae, ranks=3, rank=0)
