"""Options of ``train``, ``fit`` and ``generate`` that concern devices and public models."""

from pathlib import Path

import pytest
import torch

from diff4splat.cli.common.parser import parse
from diff4splat.cli.main import run
from diff4splat.models.config.tuning import ADAPTER_FILE

TRAIN = ["train", "--config", "paper", "--stage", "dynamic"]


@pytest.mark.parametrize("dtype", ["float32", "bfloat16"])
def test_dtype_is_the_precision_of_the_recipe(dtype: str) -> None:
    assert parse([*TRAIN, "--dtype", dtype]).recipe().trainer.precision == dtype


def test_paper_shards_recomputes_and_defers() -> None:
    trainer = parse(TRAIN).recipe().trainer
    assert (trainer.parallel, trainer.recompute, trainer.defer_renders) == ("fsdp2", True, True)
    assert trainer.precision == "bfloat16"


def test_a_stage_that_was_not_measured_is_counted_for_gpus(capsys: pytest.CaptureFixture) -> None:
    assert run(["forecast", *TRAIN]) == 0
    title, head, *rows = capsys.readouterr().out.splitlines()
    assert "20,000 steps" in title and "GB each" in head
    assert [int(row.split()[0]) for row in rows] == [1, 8, 32]


def test_tokens_are_not_shared_by_one_process(capsys: pytest.CaptureFixture) -> None:
    changes = ["--set", "trainer.parallel=none", "--set", "trainer.context_parallel=2"]
    assert run([*TRAIN, *changes]) == 2
    assert "expected 1 without ddp or fsdp2, got 2" in capsys.readouterr().err


@pytest.mark.parametrize("present", [False, True])
def test_a_folder_without_an_adapter_is_refused(
    present: bool, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "lora"
    if present:
        folder.mkdir()
    assert run(["generate", "photo.png", "--lora", str(folder)]) == 2
    error = capsys.readouterr().err
    assert f"expected a folder with {ADAPTER_FILE}" in error
    assert ("without one" in error) == present


def test_an_adapter_needs_the_video_model(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / ADAPTER_FILE).write_bytes(b"")
    (tmp_path / "photo.png").write_bytes(b"")
    assert run(["generate", str(tmp_path / "photo.png"), "--lora", str(tmp_path)]) == 2
    assert "--lora: expected --fill video" in capsys.readouterr().err


def test_fit_refuses_a_device_that_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    if torch.cuda.is_available():
        pytest.skip("there is one")
    code = run(["fit", str(tmp_path), "--device", "cuda", "--out", str(tmp_path / "fit")])
    assert code == 2
    assert "--device: expected a device that this PyTorch can use" in capsys.readouterr().err
