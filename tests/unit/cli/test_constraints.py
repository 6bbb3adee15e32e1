"""Constraints of arguments: ranges, inputs and outputs, without any command."""

import os
from pathlib import Path
from typing import get_type_hints

import pytest

from diff4splat.cli.generate import Generate
from diff4splat.cli.options.camera import CameraOptions
from diff4splat.cli.options.constraints import (
    InputPath,
    Number,
    OutputFile,
    OutputFolder,
    require_writable,
)
from diff4splat.cli.options.models import FEATURE_NETWORKS
from diff4splat.errors import ConfigError, InputError, OutputError
from diff4splat.generation.inputs.input_image import MAX_SIDE_PX
from diff4splat.generation.settings import MAX_STEPS
from diff4splat.metrics.features.backbones import BACKBONES
from diff4splat.paths.limits import MAX_AMPLITUDE, MAX_POSES


@pytest.mark.parametrize(
    ("range_", "bad", "says"),
    [
        (Number(least=1, most=3), 4, "expected 1 to 3, got 4"),
        (Number(least=1), 0, "expected at least 1, got 0"),
        (Number(above=0), 0.0, "expected more than 0, got 0"),
        (Number(above=0, most=9), 10.0, "expected more than 0 and at most 9, got 10"),
        (Number(most=9), 10.0, "expected at most 9, got 10"),
        (Number(), float("inf"), "expected a finite number, got inf"),
        (Number(above=0), float("nan"), "expected more than 0, got nan"),
        (Number(least=0), (1.0, -1.0), "expected at least 0, got -1"),
        (Number(least=0, most=2**63 - 1), 10**30, "got 1e\\+30"),
    ],
)
def test_numbers_out_of_range(range_: Number, bad: float, says: str) -> None:
    with pytest.raises(ConfigError, match=f"^--x: .*{says}$"):
        range_.check("--x", bad)


@pytest.mark.parametrize("good", [1, 2.5, 3, (1, 3)])
def test_numbers_in_range(good: float) -> None:
    Number(least=1, most=3).check("--x", good)


def test_inputs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "empty").touch()
    (tmp_path / "file").write_text("x")
    both, file = InputPath(what="a thing"), InputPath(what="a thing", folder=False)
    both.check("--x", (tmp_path, tmp_path / "file"))
    for name in ("pipe", "empty", "missing", "x" * 300):
        with pytest.raises(InputError, match="expected a thing"):
            both.check("--x", tmp_path / name)
    with pytest.raises(InputError, match="got a folder"):
        file.check("--x", tmp_path)
    with pytest.raises(InputError, match="got a file; name the folder"):
        InputPath(what="a thing", file=False).check("--x", tmp_path / "file")


def test_outputs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "file.png").write_text("x")
    for name in ("file.png", "new.png", "new/folder/a.PNG"):
        OutputFile(suffixes=(".png",)).check("--out", tmp_path / name)
    OutputFolder().check("--out", tmp_path)
    OutputFolder().check("--out", tmp_path / "new" / "folder")
    with pytest.raises(ConfigError, match=r"ending in \.png, got .*a\.gif"):
        OutputFile(suffixes=(".png",)).check("--out", tmp_path / "a.gif")
    for name in ("pipe.png", "file.png/below.png", "x" * 300 + ".png"):
        with pytest.raises(OutputError, match="expected to write here, but"):
            OutputFile().check("--out", tmp_path / name)
    for name in ("file.png", "file.png/below"):
        with pytest.raises(OutputError, match="a file stands where a folder is needed"):
            OutputFolder().check("--out", tmp_path / name)
    with pytest.raises(OutputError, match="a folder stands where the file should go"):
        OutputFile().check("--out", tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"pipe.png", "file.png"}


def test_a_folder_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(OutputError, match="no permission to write there"):
        require_writable(tmp_path / "a", is_folder=False)


def constraint(options: type, name: str) -> Number:
    return get_type_hints(options, include_extras=True)[name].__metadata__[0]


def test_bounds_are_those_of_the_library() -> None:
    assert constraint(Generate, "steps") == Number(least=1, most=MAX_STEPS)
    assert constraint(Generate, "resolution").most == MAX_SIDE_PX
    assert constraint(CameraOptions, "frames") == Number(least=1, most=MAX_POSES)
    assert constraint(CameraOptions, "amplitude") == Number(
        least=-MAX_AMPLITUDE, most=MAX_AMPLITUDE
    )
    assert set(FEATURE_NETWORKS) == set(BACKBONES)
