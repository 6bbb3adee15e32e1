"""SPZ: rounding as promised, our axes again, and what damaged files are answered."""

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from oracles_render import random_gaussians

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.io.spz.spz_columns import (
    fraction_bits,
    pack_positions,
    pack_smallest_three,
    unpack_positions,
    unpack_smallest_three,
)
from diff4splat.io.spz.spz_file import read_spz, write_spz
from diff4splat.scene.gaussians import Gaussians

COUNT = 40


def some(degree: int = 3) -> Gaussians:
    cloud = random_gaussians(COUNT, dtype=torch.float32)
    sh = torch.linspace(-0.9, 0.9, COUNT * (degree + 1) ** 2 * 3).view(COUNT, -1, 3)
    return Gaussians(
        means=cloud.means,
        quats=torch.nn.functional.normalize(cloud.quats, dim=-1),
        scales=cloud.scales,
        opacities=cloud.opacities,
        sh=sh,
    )


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_every_number_comes_back_within_its_step(tmp_path: Path, degree: int) -> None:
    gaussians = some(degree)
    write_spz(gaussians, tmp_path / "a.spz")
    again = read_spz(tmp_path / "a.spz")
    assert float((again.means - gaussians.means).abs().max()) < 1e-5
    assert float((again.scales / gaussians.scales).log().abs().max()) <= 0.5 / 16 + 1e-5
    assert float((again.opacities - gaussians.opacities).abs().max()) <= 0.5 / 255 + 1e-6
    turned = (again.quats * gaussians.quats).sum(-1).abs()
    assert float(turned.min()) > 1 - 1e-5
    first = (again.sh - gaussians.sh).abs()
    assert float(first[:, 0].max()) <= 0.5 / (0.15 * 255) + 1e-5
    assert not degree or float(first[:, 1:].max()) <= 1.1 * 16 / 256


def test_equal_scenes_have_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.spz", "b.spz"):
        write_spz(some(), tmp_path / name)
    assert (tmp_path / "a.spz").read_bytes() == (tmp_path / "b.spz").read_bytes()


def test_another_program_reads_the_same(tmp_path: Path) -> None:
    gsply = pytest.importorskip("gsply", reason="pip install 'diff4splat[formats]'")
    gaussians = some()
    write_spz(gaussians, tmp_path / "a.spz")
    found, turned = gsply.read_spz(tmp_path / "a.spz"), half_turn_about_x(gaussians)
    np.testing.assert_allclose(found.means, turned.means, atol=1e-5)
    np.testing.assert_allclose(found.scales, turned.scales.log(), atol=0.032)
    quats = torch.nn.functional.normalize(torch.from_numpy(np.asarray(found.quats)), dim=-1)
    assert float((quats * turned.quats).sum(-1).abs().min()) > 1 - 1e-5
    rest = np.asarray(found.shN).reshape(COUNT, 15, 3)
    np.testing.assert_allclose(rest, turned.sh[:, 1:], atol=1.1 * 16 / 256)


@given(st.lists(st.floats(-3e5, 3e5), min_size=3, max_size=3))
def test_positions_use_the_bits_that_there_are(point: list[float]) -> None:
    means = np.array([point])
    bits = fraction_bits(means)
    again = unpack_positions(pack_positions(means, bits), bits)
    assert np.abs(again - means).max() <= 0.5 / 2**bits


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: max(map(abs, q)) > 0.1))
def test_quaternions_keep_three_digits(quat: list[float]) -> None:
    unit = np.array([quat]) / np.linalg.norm(quat)
    again = unpack_smallest_three(pack_smallest_three(unit))
    assert abs((unit * again).sum()) > 1 - 5e-6


def test_version_two_is_read(tmp_path: Path) -> None:
    head = struct.pack("<IIIBBBB", 0x5053474E, 2, 1, 0, 8, 0, 0)
    body = bytes([0, 1, 0, 0, 255, 255, 0, 0, 0, 255, 128, 128, 128, 160, 160, 160, 128, 128, 128])
    (tmp_path / "a.spz").write_bytes(gzip.compress(head + body))
    found = read_spz(tmp_path / "a.spz")
    torch.testing.assert_close(found.means, torch.tensor([[1.0, 1.0, 0.0]]))
    torch.testing.assert_close(found.scales, torch.ones(1, 3))
    assert float(found.quats[0, 0].abs()) > 0.999


def header(version: int = 3, count: int = 1, degree: int = 0, magic: int = 0x5053474E) -> bytes:
    return struct.pack("<IIIBBBB", magic, version, count, degree, 12, 0, 0)


def packed(content: bytes) -> bytes:
    return gzip.compress(content, mtime=0)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"not gzip",
        packed(b"short"),
        packed(header(version=9)),
        packed(header(magic=1)),
        packed(header(count=0)),
        packed(header(count=2**32 - 1)),
        packed(header(degree=4)),
        packed(header() + bytes(19)),
        packed(header() + bytes(21)),
        packed(header() + bytes(20))[:-9],
    ],
    ids=range(11),
)
def test_damaged_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.spz").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"a\.spz: "):
        read_spz(tmp_path / "a.spz")


def test_a_bomb_is_read_no_further_than_its_header_says(tmp_path: Path) -> None:
    (tmp_path / "a.spz").write_bytes(gzip.compress(header() + bytes(50_000_000)))
    with pytest.raises(FileFormatError, match="expected 20 bytes"):
        read_spz(tmp_path / "a.spz")


@pytest.mark.parametrize("name", ["means", "scales", "sh"])
def test_numbers_that_are_none_are_not_written(tmp_path: Path, name: str) -> None:
    values = {field: getattr(some(), field).clone() for field in Gaussians.__slots__}
    values[name].view(-1)[0] = float("nan")
    with pytest.raises(InputError, match=f"of '{name}'"):
        write_spz(Gaussians(**values), tmp_path / "a.spz")
    assert not list(tmp_path.iterdir())
