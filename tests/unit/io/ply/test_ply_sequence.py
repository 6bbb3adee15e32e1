"""Numbered PLY files: one per time, each saying when it was taken."""

from pathlib import Path

import oracles_io
import pytest
import torch

from diff4splat.errors import InputError, OutputError
from diff4splat.io.ply.ply_file import read_ply, write_ply_sequence


def test_every_file_holds_the_scene_at_its_time(tmp_path: Path) -> None:
    scene, steps = oracles_io.scene(), []
    times_s = [0.0, 0.3, 1.7, 2.0]
    files = write_ply_sequence(scene, tmp_path / "a" / "b", times_s, lambda: steps.append(1))
    assert files == [tmp_path / "a" / "b" / f"frame_000{i}.ply" for i in range(4)]
    assert sorted((tmp_path / "a" / "b").iterdir()) == files
    assert len(steps) == 4
    for i, (file, time_s) in enumerate(zip(files, times_s, strict=True)):
        want = scene.state_at(time_s)
        torch.testing.assert_close(read_ply(file).means, want.means)
        torch.testing.assert_close(read_ply(file).scales, want.scales, rtol=1e-5, atol=0)
        comments, _, _ = oracles_io.read_ply_plainly(file.read_bytes())
        assert f"time_s {time_s:.9g}" in comments
        assert f"frame {i} of 4" in comments


def test_the_same_sequence_may_be_written_again_but_not_a_shorter_one(tmp_path: Path) -> None:
    scene = oracles_io.scene()
    write_ply_sequence(scene, tmp_path, [0.0, 1.0])
    (tmp_path / "notes.txt").write_text("mine")
    write_ply_sequence(scene, str(tmp_path), [0.0, 2.0])
    with pytest.raises(OutputError, match=r"got 1 such as frame_0001\.ply; remove them") as caught:
        write_ply_sequence(scene, tmp_path, [0.0])
    assert str(tmp_path) in str(caught.value)
    assert len(list(tmp_path.iterdir())) == 3


def test_no_times(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected at least one time"):
        write_ply_sequence(oracles_io.scene(), tmp_path / "a", [])
    assert list(tmp_path.iterdir()) == []


def test_a_file_where_the_folder_should_be(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("precious")
    for folder in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(OutputError, match="a file stands where a folder is needed"):
            write_ply_sequence(oracles_io.scene(), folder, [0.0])
    assert (tmp_path / "a").read_text() == "precious"
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]
