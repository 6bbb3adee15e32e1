"""Distances along rays have a channel of their own, so that nobody takes them for z."""

import json
from pathlib import Path

import OpenEXR
import oracles_io
import pytest
import torch

from diff4splat.errors import FileFormatError
from diff4splat.io.exr import read_depth_exr, write_depth_exr


def test_distance_comes_back_and_is_not_read_as_depth(tmp_path: Path) -> None:
    values, path = torch.rand(2, 6, 8) + 1, oracles_io.camera_path()
    write_depth_exr(values, path, tmp_path / "a.exr", quantity="distance", optics='{"lens": 1}')
    got, _ = read_depth_exr(tmp_path / "a.exr", "distance")
    assert torch.equal(got, values)
    with pytest.raises(FileFormatError, match="expected a channel 'Z', got distance: z and"):
        read_depth_exr(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as opened:
        header = dict(opened.parts[0].header)
    assert "length of the ray" in header["conventions"]
    assert json.loads(header["optics"]) == {"lens": 1}


def test_depth_is_not_read_as_distance(tmp_path: Path) -> None:
    write_depth_exr(torch.ones(2, 6, 8), oracles_io.camera_path(), tmp_path / "a.exr")
    with pytest.raises(FileFormatError, match="expected a channel 'distance', got Z"):
        read_depth_exr(tmp_path / "a.exr", "distance")
