"""Depth videos as OpenEXR: nothing is lost, and nothing damaged is believed."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import oracles_io
import pytest
import torch

from diff4splat.errors import FileFormatError, InputError, OutputError, ShapeError
from diff4splat.io import exr
from diff4splat.io.exr import read_depth_exr, write_depth_exr


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_depth_exr(torch.rand(2, 6, 8) + 1, oracles_io.camera_path(), tmp_path / "a.exr")
    return tmp_path / "a.exr"


def refusal(file: Path) -> str:
    with pytest.raises(FileFormatError) as caught:
        read_depth_exr(file)
    assert str(caught.value).isprintable()
    assert str(file) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("frames", [1, 3])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_depth_and_cameras_come_back_exactly(
    tmp_path: Path, frames: int, dtype: torch.dtype
) -> None:
    path = oracles_io.camera_path(frames, dtype=dtype)
    path = replace(
        path,
        times_s=path.times_s / 3,
        cameras=replace(path.cameras, focal_px=path.cameras.focal_px / 3),
    )
    depth = torch.rand(frames, 6, 8) * 1e-3 + 1e3
    write_depth_exr(depth, path, str(tmp_path / "a.exr"))
    got, back = read_depth_exr(str(tmp_path / "a.exr"))
    assert got.dtype == torch.float32
    assert torch.equal(got, depth)
    assert torch.equal(back.times_s, path.times_s.double())
    assert torch.equal(back.cameras.focal_px, path.cameras.focal_px.double())
    assert torch.equal(back.cameras.center_px, path.cameras.center_px.double())
    assert torch.equal(back.cameras.world_from_camera, path.cameras.world_from_camera.double())
    assert back.cameras.size_px == (6, 8)


def test_what_others_find_in_the_file(tmp_path: Path) -> None:
    path = oracles_io.camera_path(3)
    write_depth_exr(torch.ones(3, 6, 8), path, tmp_path / "a.exr", unit="metres")
    with OpenEXR.File(str(tmp_path / "a.exr")) as opened:
        for i, part in enumerate(opened.parts):
            assert part.name() == f"frame_000{i}"
            assert list(part.channels) == ["Z"]
            assert part.channels["Z"].pixels.dtype == np.float32
            assert part.header["compression"] == OpenEXR.ZIP_COMPRESSION
            assert part.header["unit"] == "metres"
            assert "OpenCV" in part.header["conventions"]
            assert part.header["time_s"].tolist() == [i / 4]
            assert np.array_equal(
                part.header["world_from_camera"], path.cameras.world_from_camera[i]
            )


def test_depth_that_is_none_becomes_0(tmp_path: Path) -> None:
    depth = torch.ones(2, 6, 8, dtype=torch.float64)
    depth[0, 0, :4] = torch.tensor([float("nan"), float("inf"), -float("inf"), -1.0])
    depth[1, 5, 7] = 1e300
    write_depth_exr(depth, oracles_io.camera_path(), tmp_path / "a.exr")
    got, _ = read_depth_exr(tmp_path / "a.exr")
    assert got[0, 0].tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert got[1, 5, 7] == 0


def test_equal_depth_gives_equal_bytes_and_no_chatter(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.exr", "b.exr"):
        write_depth_exr(torch.ones(2, 6, 8), oracles_io.camera_path(), tmp_path / name)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("shape", [(3, 6, 8), (2, 6, 9), (2, 8, 6)])
def test_depth_that_does_not_fit_the_path(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match=r"depth: expected \(2, 6, 8\) \(from the camera path\)"):
        write_depth_exr(torch.ones(shape), oracles_io.camera_path(), tmp_path / "a.exr")


def test_no_frames(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected at least one frame"):
        write_depth_exr(torch.ones(0, 6, 8), oracles_io.camera_path(0), tmp_path / "a.exr")


def test_pixels_lost_without_a_word_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = exr._write

    def lossy(parts: list[OpenEXR.Part], temporary: Path) -> None:
        whole(parts, temporary)
        temporary.write_bytes(temporary.read_bytes()[:-20])

    monkeypatch.setattr(exr, "_write", lossy)
    with pytest.raises(OutputError, match="the file came out incomplete"):
        write_depth_exr(torch.rand(2, 6, 8), oracles_io.camera_path(), tmp_path / "a.exr")
    assert list(tmp_path.iterdir()) == []


def test_missing_folder_empty_and_other_kinds(tmp_path: Path) -> None:
    assert "got no such file" in refusal(tmp_path / "no.exr")
    assert "got a folder" in refusal(tmp_path)
    (tmp_path / "a.exr").touch()
    assert "got an empty file" in refusal(tmp_path / "a.exr")
    (tmp_path / "a.exr").write_bytes(random.Random(0).randbytes(500))
    assert "expected a whole OpenEXR file, got a damaged or other one" in refusal(
        tmp_path / "a.exr"
    )


def test_exr_of_other_programs(tmp_path: Path) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    part = OpenEXR.Part(header, {"Z": np.ones((6, 8), np.float32)}, "other")
    with OpenEXR.File([part]) as opened:
        opened.write(str(tmp_path / "a.exr"))
    assert "got an OpenEXR file of another kind" in refusal(tmp_path / "a.exr")


def test_attributes_that_are_missing_or_senseless(tmp_path: Path) -> None:
    header = exr._header(oracles_io.camera_path(1), 0, "metres")
    for name, bad in (("focal_px", None), ("time_s", 0.5), ("world_from_camera", np.zeros((4, 4)))):
        changed = {k: v for k, v in {**header, name: bad}.items() if v is not None}
        part = OpenEXR.Part(changed, {"Z": np.ones((6, 8), np.float32)}, "frame_0000")
        with OpenEXR.File([part]) as opened:
            opened.write(str(tmp_path / "a.exr"))
        says = "path: expected rotations" if name == "world_from_camera" else f"attribute '{name}'"
        assert says in refusal(tmp_path / "a.exr")


def test_truncation_anywhere_is_noticed_in_silence(
    file: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = file.read_bytes()
    for length in [*range(1, len(whole), 23), len(whole) - 1]:
        file.write_bytes(whole[:length])
        assert "expected" in refusal(file)
    assert capfd.readouterr() == ("", "")


def test_damaged_bytes_never_end_in_another_exception(
    file: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole, source = file.read_bytes(), random.Random(1)
    for _ in range(200):
        damaged = bytearray(whole)
        for _ in range(3):
            damaged[source.randrange(len(damaged))] = source.randrange(256)
        file.write_bytes(damaged)
        try:
            read_depth_exr(file)
        except FileFormatError as error:
            assert str(error).isprintable()
    assert capfd.readouterr() == ("", "")
