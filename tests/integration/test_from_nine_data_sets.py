"""Procedural clips as all nine data sets → doctor → align → curate → shards → training.

Preparation is killed at random points on the way, and finished by the same commands.
"""

import random
from pathlib import Path

import numpy as np
import pytest
from killed_step import changes_of
from procedural_truth import procedural_truth
from toy_datasets import TOYS
from toy_scene import Truth
from training_commands import rows

from diff4splat.cli.main import run
from diff4splat.data.clip_folder import ClipFolder

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
FIRST_WORLD = 8
"""Of worlds in which less than half of what is seen moves: else medians say nothing of cameras."""
SCALE = 3
"""Sides of the writers' usual images are that many times longer: features need pixels."""
ALIGNED = {"realestate10k": "triangulation", "stereo4d": "tracks"}
THRESHOLDS = """
version = 1
[[gate]]
stage = "geometry"
score = "reprojection_error"
most = 0.2
reason = "depth and cameras disagree"
"""


def write_copies(root: Path) -> dict[str, Truth]:
    truths = {}
    for number, name in enumerate(NINE):
        toy, writer = TOYS[name], TOYS[name].writer
        size_px = tuple(SCALE * side for side in writer.SIZE_PX)
        lens = tuple(SCALE * value for value in writer.LENS)
        baseline_m = getattr(writer, "BASELINE_M", 0.0)
        truth = procedural_truth(FIRST_WORLD + number, size_px, lens, baseline_m, toy.static)
        toy.write(truth, root / toy.dataset)
        truths[toy.dataset] = truth
    return truths


def prepare(arguments: list[str], drawn: random.Random) -> None:
    """One command of ``prepare``: killed where chance wants it, and then run to its end."""
    for _ in range(2):
        changes_of(["prepare", *arguments], kill_at=drawn.randint(1, 60))
    assert changes_of(["prepare", *arguments]) is not None


def prepared(copies: Path, out: Path, disparity: Path, drawn: random.Random | None) -> Path:
    """All clips of all sets as one folder of selected clips; ``drawn`` kills."""
    folders = []
    for name in [TOYS[name].dataset for name in NINE]:
        folder = out / "imported" / name
        given = ["import", str(copies / name), "--dataset", name, "--frames", "9", "--append"]
        run_or_kill([*given, "--out", str(folder)], drawn)
        if name in ALIGNED:
            aligned = out / "aligned" / name
            given = ["align", str(folder), "--reference", ALIGNED[name], "--out", str(aligned)]
            run_or_kill([*given, "--disparity", str(disparity)], drawn)
            folder = aligned
        folders.append(str(folder))
    (out / "thresholds.toml").write_text(THRESHOLDS)
    given = ["curate", *folders, "--out", str(out / "report")]
    given += ["--thresholds", str(out / "thresholds.toml"), "--shards", str(out / "selected")]
    run_or_kill(given, drawn)
    return out / "selected"


def run_or_kill(arguments: list[str], drawn: random.Random | None) -> None:
    if drawn is None:
        assert run(["prepare", *arguments]) == 0
    else:
        prepare(arguments, drawn)


def write_disparity(truths: dict[str, Truth], copies: Path, folder: Path) -> None:
    """As Video Depth Anything would: an affine function of 1 / z, named after the clips."""
    folder.mkdir()
    for name in ALIGNED:
        out = folder / f"names of {name}"
        given = [str(copies / name), "--dataset", name, "--frames", "9", "--out", str(out)]
        assert run(["prepare", "import", *given]) == 0
        (identifier,) = ClipFolder(out).identifiers
        disparity = 3.0 / truths[name].left.depth + 0.02 * (truths[name].left.which >= 0)
        np.savez(folder / f"{identifier}_depths.npz", depths=disparity.astype(np.float32))


def shards(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.suffix != ".csv"}


@pytest.mark.slow
def test_nine_data_sets_are_prepared_and_learnt_from(tmp_path: Path) -> None:
    copies, disparity = tmp_path / "copies", tmp_path / "disparity"
    truths = write_copies(copies)
    for name in truths:
        given = [str(copies / name), "--dataset", name, "--out", str(tmp_path / f"{name}.png")]
        assert run(["prepare", "doctor", *given]) == 0
    write_disparity(truths, copies, disparity)
    for out in ("whole", "killed"):
        (tmp_path / out).mkdir()
    selected = prepared(copies, tmp_path / "whole", disparity, None)
    killed = prepared(copies, tmp_path / "killed", disparity, random.Random(1))
    assert shards(killed) == shards(selected)
    sets = {entry.dataset for entry in ClipFolder(selected).entries}
    assert sets == {TOYS[name].dataset for name in NINE}
    command = ["train", "--config", "test", "--device", "cpu", "--ignore-gates"]
    command += ["--clips", str(selected), "--out", str(tmp_path / "run")]
    for stage in ("vae", "static-low"):
        assert run([*command, "--stage", stage, "--steps", "10"]) == 0
        assert len(rows(tmp_path / "run" / stage, "step")) == 10
