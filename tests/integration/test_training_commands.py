"""The whole course through the command line: clips, six stages, a scene, a judgement."""

import json
import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import FRAMES, SIZE_PX, changes
from oracles_evaluation import tiny_protocol
from PIL import Image
from training_commands import (
    DRAWN,
    SAVING,
    STAGES,
    arguments,
    assert_same,
    refusal,
    rows,
    train,
    weights,
)

from diff4splat.cli.main import run
from diff4splat.evaluation.protocols.protocol_json import protocol_json
from diff4splat.io.photos.images import write_png
from diff4splat.training.prerequisites import last_checkpoint


def test_worlds_are_drawn_checked_and_learnt_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "clips"
    assert run(["prepare", "synth", "--out", str(out), "--clips", "2", *DRAWN]) == 0
    assert "wrote 2 clips" in capsys.readouterr().err
    with Image.open(out / "clips.png") as image:
        assert image.size == (2 * (64 + 4), 32 + 4)
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
    assert provenance["trained"] == ["vae", "text_encoder", "dit", "ldrm", "deformation"]


def test_the_trained_model_makes_a_scene(
    course: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_png(torch.rand(40, 40, 3), tmp_path / "photo.png")
    made = ["generate", str(tmp_path / "photo.png"), "--model", str(course / "model")]
    assert run([*made, "--out", str(tmp_path / "out"), "--steps", "1", "--frames", "2"]) == 0
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert "untrained" not in json.dumps(card).replace('"untrained": false', "")


@pytest.mark.parametrize(
    "task",
    ["generation", *(pytest.param(t, marks=pytest.mark.slow) for t in ("reconstruction", "text"))],
)
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


def test_a_polite_stop_saves_and_the_same_command_goes_on(
    six_steps: Path,
    shards: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    step, updates = torch.optim.AdamW.step, []

    def signalling(optimizer: torch.optim.AdamW) -> None:
        step(optimizer)
        updates.append(optimizer)
        if len(updates) == 2:  # the step after the signal is the last
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(torch.optim.AdamW, "step", signalling)
    given = arguments("vae", shards, tmp_path, *SAVING, steps=6)
    assert run(given) == 0
    monkeypatch.undo()
    assert "the same command goes on" in capsys.readouterr().out
    stopped = json.loads((tmp_path / "vae" / "result.json").read_text())
    assert (stopped["step"], stopped["finished"]) == (3, False)
    assert run(given) == 0
    assert_same(weights(tmp_path), weights(six_steps))
