"""What tests of the training commands share."""

import json
from pathlib import Path

import pytest
import torch
from clip_shards import changes

from diff4splat.cli.main import run
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.trainer.checkpoints.export import load_parts

STAGES = ("vae", "static-low", "static-high", "dynamic", "video_diffusion", "joint")
DRAWN = ("--size", "32", "--frames", "5", "--views", "2", "--tracks", "16")
SAVING = ("--set", "trainer.checkpoint_every=2", "trainer.keep_checkpoints=9")


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


def weights(run_folder: Path, stage: str = "vae") -> dict[str, torch.Tensor]:
    parts = load_parts(last_checkpoint(run_folder / stage), "raw")
    return {f"{part}.{key}": value for part, held in parts.items() for key, value in held.items()}


def assert_same(first: dict[str, torch.Tensor], second: dict[str, torch.Tensor]) -> None:
    assert first.keys() == second.keys()
    for key, value in first.items():
        assert torch.equal(value, second[key]), key
