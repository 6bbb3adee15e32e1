"""The whole course through the command line: clips, six stages, a scene, a judgement."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import FRAMES, SIZE_PX, changes, reading, write_shards
from oracles_evaluation import tiny_protocol
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.errors import ConfigError
from diff4splat.io.images import write_png
from diff4splat.training.evaluation.protocol_json import protocol_json
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.trainer.export import load_parts
from diff4splat.training.trainer.sampler import plan_batches

STAGES = ("vae", "static-low", "static-high", "dynamic", "generator", "joint")
DRAWN = ("--size", "32", "--frames", "5", "--views", "2", "--tracks", "16")


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=4, moving=4)


def arguments(stage: str, folder: Path, out: Path, *more: str, steps: int = 2) -> list[str]:
    wanted = changes(stage, folder, steps)
    return [
        "train",
        "--config",
        "test",
        "--stage",
        stage,
        "--out",
        str(out),
        "--set",
        *wanted,
        *more,
    ]


def train(stage: str, folder: Path, out: Path, *more: str, steps: int = 2) -> int:
    return run(arguments(stage, folder, out, *more, steps=steps))


@pytest.fixture(scope="module")
def course(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run")
    for stage in STAGES:
        assert train(stage, shards, out, "--ignore-gates") == 0
    return out


def contents(folder: Path) -> dict[Path, bytes]:
    return {file: file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def refusal(capsys: pytest.CaptureFixture[str]) -> str:
    """The only line of error."""
    lines = capsys.readouterr().err.splitlines()
    (line,) = [line for line in lines if line.startswith("diff4splat:")]
    assert not any("Traceback" in line for line in lines)
    assert ": expected " in line
    return line


def rows(folder: Path, event: str) -> list[dict]:
    found = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [row for row in found if row["event"] == event]


def test_worlds_are_drawn_checked_and_learnt_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "clips"
    assert run(["prepare", "synth", "--out", str(out), "--clips", "2", *DRAWN]) == 0
    assert "wrote 2 clips" in capsys.readouterr().err
    with Image.open(out / "clips.png") as picture:
        assert picture.size == (2 * (64 + 4), 32 + 4)
    again = ["prepare", "synth", "--out", str(out), "--clips", "3", *DRAWN]
    assert run(again) == 2
    assert "append to it" in refusal(capsys)
    assert run([*again, "--append"]) == 0
    assert "wrote 1 clips" in capsys.readouterr().err
    assert run(["prepare", "check", "--folder", str(out), "--most", "1"]) == 0
    assert "| projection_px |" in capsys.readouterr().out
    assert train("vae", out, tmp_path / "run", "--steps", "1") in (0, 2)


def test_every_stage_is_trained(course: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for stage in STAGES:
        result = json.loads((course / stage / "result.json").read_text())
        assert (result["finished"], result["step"]) == (True, 2)
        assert len(rows(course / stage, "step")) == 2
        assert len(list((course / stage / "panels").glob("*.png"))) == 1
    provenance = json.loads((course / "model" / "provenance.json").read_text())
    assert provenance["untrained"] is False


def test_the_trained_model_makes_a_scene(
    course: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_png(torch.rand(40, 40, 3), tmp_path / "photo.png")
    made = ["generate", str(tmp_path / "photo.png"), "--model", str(course / "model")]
    assert run([*made, "--out", str(tmp_path / "out"), "--steps", "1", "--frames", "2"]) == 0
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert "untrained" not in json.dumps(card).replace('"untrained": false', "")


@pytest.mark.parametrize("task", ["generation", "reconstruction", "text"])
def test_the_trained_model_is_judged(
    task: str, course: Path, shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = tiny_protocol(2)
    source = replace(tiny.source, kind="shards", folder=str(shards), first=4)
    loop = replace(tiny.loop, size_px=SIZE_PX)
    protocol = replace(tiny, source=source, size_px=SIZE_PX, frames=FRAMES, loop=loop)
    (tmp_path / "tiny.json").write_text(protocol_json(protocol))
    judge = ["eval", "--model", str(course / "model"), "--protocol", str(tmp_path / "tiny.json")]
    out = tmp_path / "out"
    assert run([*judge, "--task", task, "--out", str(out), "--steps", "1"]) == 0
    assert capsys.readouterr().out.count("|") > 10
    assert json.loads((out / "results.json").read_text())["table"]
    assert (out / "items.png").is_file()


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


def test_the_recipe_of_a_run_can_be_used_again(
    course: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = course / "vae" / "recipe.json"
    shutil.copytree(course / "vae", tmp_path / "vae")
    again = ["train", "--config", str(recipe), "--stage", "vae", "--out", str(tmp_path)]
    assert run(again) == 0
    assert "vae: step 2 of 2" in capsys.readouterr().out


def test_changes_may_be_given_one_by_one(shards: Path, tmp_path: Path) -> None:
    steps, source = changes("vae", shards, steps=1)
    command = ["train", "--config", "test", "--stage", "vae", "--out", str(tmp_path)]
    assert run([*command, "--set", steps, "--set", source]) == 0
    written = json.loads((tmp_path / "vae" / "recipe.json").read_text())["stages"][0]
    assert (written["steps"], written["data"]["sources"][0]["kind"]) == (1, "shards")


def test_a_stage_waits_for_those_before_it(
    course: Path, shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train("static-low", shards, tmp_path) == 2
    assert "vae/result.json" in (line := refusal(capsys)) and "train that stage first" in line
    shutil.copytree(course / "vae", tmp_path / "vae")
    gate = 'stages.vae.gates=[{"measure": "psnr", "bound": 90}]'
    assert train("static-low", shards, tmp_path, "--set", gate) == 2
    line = refusal(capsys)
    assert "expected psnr at least 90, got" in line and "--ignore-gates" in line
    assert not (tmp_path / "static-low").exists()


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


def weights(run_folder: Path, stage: str = "vae") -> dict[str, torch.Tensor]:
    parts = load_parts(last_checkpoint(run_folder / stage), "raw")
    return {f"{part}.{key}": value for part, held in parts.items() for key, value in held.items()}


def assert_same(first: dict[str, torch.Tensor], second: dict[str, torch.Tensor]) -> None:
    assert first.keys() == second.keys()
    for key, value in first.items():
        assert torch.equal(value, second[key]), key


SAVING = ("--set", "trainer.checkpoint_every=2", "trainer.keep_checkpoints=9")


@pytest.fixture(scope="module")
def six_steps(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An autoencoder that was never stopped."""
    out = tmp_path_factory.mktemp("six")
    assert train("vae", shards, out, *SAVING, steps=6) == 0
    return out


def test_a_half_written_checkpoint_is_passed_over(
    six_steps: Path, shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(six_steps, tmp_path / "run")
    newest = last_checkpoint(tmp_path / "run" / "vae")
    (file,) = newest.glob("*.safetensors")
    file.write_bytes(file.read_bytes()[:1000])
    assert train("static-low", shards, tmp_path / "run") == 2
    assert "run stage vae again" in refusal(capsys)
    assert train("vae", shards, tmp_path / "run", *SAVING, steps=6) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "the checkpoint before it is taken" in said
    assert "vae: resumed at step 4" in said
    assert_same(weights(tmp_path / "run"), weights(six_steps))


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

    monkeypatch.setattr("diff4splat.training.trainer.checkpoint.os.replace", full)
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
        (("--workers", "0"), ("--workers", "1, 0 and 0")),
        (("--size", "3"), ("size", "8 to 4096", "got 3")),
        (("--frames", "1"), ("frames", "2 to 1000", "got 1")),
        (("--views", "0"), ("views", "1 to 8", "got 0")),
        (("--tracks", "-1"), ("tracks", "at least 0", "got -1")),
        (("--still-share", "2"), ("still_share", "0 to 1", "got 2")),
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


def command(*given: str) -> list[str]:
    return [sys.executable, "-m", "diff4splat.cli.main", *given]


def wait_for(file: Path, word: str, seconds: float = 90) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if file.is_file() and word in file.read_text():
            return
        time.sleep(0.05)
    raise AssertionError(f"{file} never said {word}")


def test_a_polite_stop_saves_and_the_same_command_goes_on(shards: Path, tmp_path: Path) -> None:
    out, steps = tmp_path / "stopped", 40
    given = arguments("vae", shards, out, steps=steps)
    process = subprocess.Popen(
        command(*given), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        wait_for(out / "vae" / "log.jsonl", '"step": 3')
        process.send_signal(signal.SIGTERM)
        said, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "the same command goes on" in said
    stopped = json.loads((out / "vae" / "result.json").read_text())
    assert 3 < stopped["step"] < steps and not stopped["finished"]
    assert run(given) == 0
    assert train("vae", shards, tmp_path / "whole", steps=steps) == 0
    assert_same(weights(out), weights(tmp_path / "whole"))
