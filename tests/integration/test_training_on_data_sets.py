"""Copies of training data sets become shards, and a mixture of them is learnt from."""

from pathlib import Path

import pytest
from toy_datasets import TOYS
from toy_scene import make_truth
from training_commands import STAGES, rows

from diff4splat.cli.main import run
from diff4splat.data.clip import Clip
from diff4splat.data.shard_writer import ShardWriter

NINE = (
    "tartanair",
    "matrixcity half",
    "point_odyssey",
    "dynamic_replica",
    "spring",
    "vkitti2",
    "multicam_video",
    "realestate10k",
    "stereo4d",
)


def imported(name: str, folder: Path) -> Path:
    toy = TOYS[name]
    out = folder / f"shards {toy.dataset}"
    writer, root = toy.writer, folder / toy.dataset
    baseline_m = getattr(writer, "BASELINE_M", 0.0)
    toy.write(make_truth(writer.SIZE_PX, writer.LENS, baseline_m, toy.static, frames=5), root)
    command = ["prepare", "import", str(root), "--dataset", toy.dataset, "--out", str(out)]
    assert run([*command, "--frames", "5", "--tracks", "16"]) == 0
    return out


def learn(stages: tuple[str, ...], folders: list[Path], out: Path, steps: int) -> None:
    clips = [text for folder in folders for text in ("--clips", f"{folder}:0.5")]
    for stage in stages:
        command = ["train", "--config", "test", "--stage", stage, "--out", str(out), *clips]
        assert run([*command, "--steps", str(steps), "--ignore-gates", "--device", "cpu"]) == 0
        assert len(rows(out / stage, "step")) == steps


def test_two_data_sets_are_mixed(tmp_path: Path) -> None:
    folders = [imported(name, tmp_path) for name in ("realestate10k", "spring")]
    learn(("vae", "static-low"), folders, tmp_path / "run", 2)


def test_a_stopped_import_goes_on_to_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = imported("spring", tmp_path)
    out, write = tmp_path / "again", ShardWriter.write

    def stop(writer: ShardWriter, clip: Clip) -> None:
        write(writer, clip)
        raise KeyboardInterrupt

    command = ["prepare", "import", str(tmp_path / "spring"), "--dataset", "spring"]
    command += ["--out", str(out), "--frames", "5", "--tracks", "16", "--append"]
    with monkeypatch.context() as patch:
        patch.setattr(ShardWriter, "write", stop)
        assert run(command) != 0
    assert not list(out.glob("*.tar"))
    for _ in range(2):  # done work is not done again
        assert run(command) == 0
        for file in whole.glob("shard-*"):
            assert (out / file.name).read_bytes() == file.read_bytes()


@pytest.mark.slow
def test_nine_data_sets_are_mixed_in_every_stage(tmp_path: Path) -> None:
    learn(STAGES, [imported(name, tmp_path) for name in NINE], tmp_path / "run", 10)
