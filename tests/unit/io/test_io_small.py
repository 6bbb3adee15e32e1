"""Bytes and levels, PNG, silence, and the first look at a path."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.photos.images import read_photo, write_png
from diff4splat.io.pixels import from_bytes, to_bytes
from diff4splat.io.require_file import require_file
from diff4splat.io.silence_stderr import separate_python_stderr, silence_native_stderr


def test_every_level_survives() -> None:
    levels = np.arange(256, dtype=np.uint8)
    assert np.array_equal(to_bytes(from_bytes(levels)), levels)


@given(value=st.floats(-(2.0**100), 2.0**100, width=32))
@settings(max_examples=25, deadline=None)
def test_levels_are_the_nearest(value: float) -> None:
    level = int(to_bytes(torch.tensor([value]))[0])
    assert abs(level / 255 - min(max(value, 0.0), 1.0)) <= 0.5 / 255 + 1e-6


def test_values_that_are_none_become_levels() -> None:
    bad = torch.tensor([float("nan"), float("inf"), -float("inf")], dtype=torch.float64)
    assert to_bytes(bad).tolist() == [0, 255, 0]
    assert to_bytes(torch.zeros(0, 4, 3)).shape == (0, 4, 3)
    assert to_bytes(torch.ones(2, requires_grad=True)).tolist() == [255, 255]


def test_png_is_exact_and_always_the_same(tmp_path: Path) -> None:
    rgb = torch.rand(20, 30, 3)
    for name in ("a.png", "b.png"):
        write_png(rgb, str(tmp_path / name))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with Image.open(tmp_path / "a.png") as image:
        assert (image.format, image.mode, image.size, image.info) == ("PNG", "RGB", (30, 20), {})
    assert bool((read_photo(tmp_path / "a.png").rgb - rgb).abs().max() <= 0.5 / 255 + 1e-6)


def test_lines_of_python_pass_through_a_silenced_block(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", sys.stderr)
    separate_python_stderr()
    with silence_native_stderr():
        print("progress", file=sys.stderr)
        os.write(2, b"native noise")
    sys.stderr.close()
    assert capfd.readouterr().err == "progress\n"


def test_native_messages_are_silenced_only_inside(capfd: pytest.CaptureFixture[str]) -> None:
    os.write(2, b"before ")
    with silence_native_stderr():
        os.write(2, b"inside ")
    with pytest.raises(ValueError, match="x"), silence_native_stderr():
        raise ValueError("x")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before after"


def test_silence_where_there_is_no_stderr_at_all() -> None:
    kept = os.dup(2)
    try:
        os.close(2)
        with silence_native_stderr():
            entered = True
    finally:
        os.dup2(kept, 2)
        os.close(kept)
    assert entered


def test_the_first_look_at_a_path(tmp_path: Path) -> None:
    (tmp_path / "good").write_text("x")
    require_file(tmp_path / "good", "a test file")
    with pytest.raises(FileFormatError, match="expected a test file, got no such file"):
        require_file(tmp_path / "missing", "a test file")
    with pytest.raises(InputError, match="got a folder; give the file itself"):
        require_file(tmp_path, "a test file", InputError)
    with pytest.raises(FileFormatError, match="got no such file"):
        require_file(tmp_path / "good" / "below", "a test file")
    with pytest.raises(FileFormatError, match="expected a test file, got"):
        require_file(tmp_path / ("x" * 300), "a test file")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileFormatError, match="got a device"):
        require_file(tmp_path / "pipe", "a test file")
