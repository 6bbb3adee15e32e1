"""SPZ version 4: the same columns as in version 3, in zstd streams."""

import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from oracles_render import random_gaussians

from diff4splat.errors import FileFormatError, MissingExtraError
from diff4splat.io.spz.spz_file import read_spz, read_spz_content, write_spz
from diff4splat.scene.gaussians import Gaussians

zstandard = pytest.importorskip("zstandard", reason="pip install 'diff4splat[spz]'")
TABLE = 32


def some(degree: int = 3, count: int = 40) -> Gaussians:
    cloud = random_gaussians(count, dtype=torch.float32)
    sh = torch.linspace(-0.9, 0.9, count * (degree + 1) ** 2 * 3).view(count, -1, 3)
    quats = torch.nn.functional.normalize(cloud.quats, dim=-1)
    return Gaussians(
        means=cloud.means, quats=quats, scales=cloud.scales, opacities=cloud.opacities, sh=sh
    )


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_versions_3_and_4_hold_the_same_numbers(tmp_path: Path, degree: int) -> None:
    write_spz(some(degree), tmp_path / "3.spz", version=3)
    write_spz(some(degree), tmp_path / "4.spz", version=4)
    three, four = read_spz(tmp_path / "3.spz"), read_spz(tmp_path / "4.spz")
    for name in Gaussians.__slots__:
        assert torch.equal(getattr(three, name), getattr(four, name)), name
    assert (tmp_path / "4.spz").read_bytes()[:8] == b"NGSP" + struct.pack("<I", 4)


@pytest.mark.parametrize("degree", [0, 2])
def test_another_program_reads_version_4(tmp_path: Path, degree: int) -> None:
    gsply = pytest.importorskip("gsply", reason="pip install 'diff4splat[formats]'")
    write_spz(some(degree), tmp_path / "a.spz", version=4)
    found, own = gsply.read_spz(tmp_path / "a.spz"), read_spz(tmp_path / "a.spz")
    turned = own.means * torch.tensor([1.0, -1, -1])
    np.testing.assert_allclose(found.means, turned, atol=1e-6)
    np.testing.assert_allclose(np.exp(found.scales), own.scales, rtol=1e-5)


def test_version_4_of_another_program_is_read(tmp_path: Path) -> None:
    gsply = pytest.importorskip("gsply", reason="pip install 'diff4splat[formats]'")
    write_spz(some(), tmp_path / "a.spz")
    gsply.write_spz(tmp_path / "b.spz", gsply.read_spz(tmp_path / "a.spz"), version=4)
    ours, theirs = read_spz(tmp_path / "a.spz"), read_spz(tmp_path / "b.spz")
    torch.testing.assert_close(ours.means, theirs.means, atol=1e-3, rtol=0)
    torch.testing.assert_close(ours.sh, theirs.sh, atol=0.13, rtol=0)


def built(
    count: int = 1, degree: int = 0, records: bytes = b"", sizes: tuple[int, ...] = ()
) -> bytes:
    """A file of one Gaussian at the origin."""
    columns = [bytes(9), b"\xff", bytes([128] * 3), bytes([160] * 3), struct.pack("<I", 3 << 30)]
    columns += [bytes([128] * 72)] if degree == 4 else []
    streams = [zstandard.ZstdCompressor().compress(column) for column in columns]
    plain = sizes or tuple(map(len, columns))
    head = struct.pack(
        "<IIIBBBBI12x", 0x5053474E, 4, count, degree, 12, 0, len(streams), 32 + len(records)
    )
    table = b"".join(struct.pack("<QQ", len(s), p) for s, p in zip(streams, plain, strict=True))
    return head + records + table + b"".join(streams)


def test_degree_4_and_unknown_extensions_are_left_out_and_noted(tmp_path: Path) -> None:
    records = struct.pack("<II3s", 0xADBE0002, 3, b"abc")
    (tmp_path / "a.spz").write_bytes(built(degree=4, records=records))
    found = read_spz_content(tmp_path / "a.spz")
    assert found.gaussians.sh.shape == (1, 16, 3)
    torch.testing.assert_close(found.gaussians.scales, torch.ones(1, 3))
    assert [note.startswith("not imported") for note in found.notes] == [True, True]


def test_other_axes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.spz").write_bytes(built(records=struct.pack("<III", 0xADBE0003, 4, 7)))
    with pytest.raises(FileFormatError, match="other axes"):
        read_spz(tmp_path / "a.spz")
    (tmp_path / "a.spz").write_bytes(built(records=struct.pack("<III", 0xADBE0003, 4, 4)))
    assert len(read_spz(tmp_path / "a.spz")) == 1


@pytest.mark.parametrize(
    "content",
    [
        built()[:20],
        built()[:40],
        built()[:-3],
        built(count=2),
        built(count=2**31),
        built(count=9_000_000),
        built(sizes=(2**63, 1, 3, 3, 4)),
        built()[:16] + struct.pack("<I", 2**32 - 1) + built()[20:],
        built()[:-20] + bytes(20),
    ],
    ids=range(9),
)
def test_damaged_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.spz").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"a\.spz: "):
        read_spz(tmp_path / "a.spz")


def test_without_the_package_one_line_says_what_to_do(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "zstandard", None)
    with pytest.raises(MissingExtraError, match=r"diff4splat\[spz\]"):
        write_spz(some(), tmp_path / "a.spz", version=4)
    assert not list(tmp_path.iterdir())
