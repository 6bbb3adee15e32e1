"""Damaged and hostile files: a named error for that clip, and the run goes on."""

import csv
import gzip
import io
import os
import pickle
import shutil
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from dataset_writers import matrixcity, realestate10k, spring
from PIL import Image
from toy_datasets import TOYS, read_clips

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.datasets.common.windows import clip_identifier
from diff4splat.data_prep.datasets.importing import ImportJob, import_dataset, summary
from diff4splat.errors import ConfigError, Diff4SplatError, FileFormatError, InputError
from diff4splat.progress.phases import Phases

Damage = Callable[[Path], None]


def cut(pattern: str, share: float = 0.5) -> Damage:
    def damage(root: Path) -> None:
        file = first(root, pattern)
        content = file.read_bytes()
        file.write_bytes(content[: int(len(content) * share)])

    return damage


def first(root: Path, pattern: str) -> Path:
    return sorted(root.rglob(pattern))[0]


def removed(pattern: str) -> Damage:
    return lambda root: first(root, pattern).unlink()


def without_last_line(pattern: str) -> Damage:
    def damage(root: Path) -> None:
        file = first(root, pattern)
        file.write_text("\n".join(file.read_text().splitlines()[:-1]) + "\n")

    return damage


def eight_bits(pattern: str) -> Damage:
    def damage(root: Path) -> None:
        file = first(root, pattern)
        with Image.open(file) as image:
            size = image.size
        Image.new("L", size, 9).save(file)

    return damage


class Trap:
    def __reduce__(self) -> tuple:
        return os.mkdir, ("trap-was-run",)


def with_trap_in_torch(root: Path) -> None:
    torch.save({"traj_2d": Trap()}, first(root, "*.pth"))


def with_trap_in_npz(root: Path) -> None:
    file = first(root, "anno.npz")
    with np.load(file) as stored:
        arrays = dict(stored)
    arrays["trajs_2d"] = np.array([Trap()], dtype=object)
    np.savez(file, **arrays)


def bomb_png(root: Path) -> None:
    """Claims 60,000 × 60,000 pixels in a hundred bytes."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    head = struct.pack(">IIBBBBB", 60_000, 60_000, 16, 0, 0, 0, 0)
    content = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
    content += chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    first(root, "depth_*.png").write_bytes(content)


def bomb_npz(root: Path) -> None:
    """An array whose header claims a terabyte."""
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (4, 23000000000, 3), }"
    header += b" " * (118 - len(header) - 1) + b"\n"
    body = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header
    file = first(root, "anno.npz")
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored if name != "trajs_3d"}
    np.savez(file, **arrays)
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("trajs_3d.npy", body)


def climbing_tar(root: Path) -> None:
    matrixcity.pack(root, prefix="../../")


def text_in(pattern: str, text: str) -> Damage:
    return lambda root: first(root, pattern).write_text(text)


def escaping_path(root: Path) -> None:
    file = first(root, "*.jgz")
    with gzip.open(file) as stream:
        text = stream.read().decode()
    with gzip.open(file, "wt") as stream:
        stream.write(text.replace('"009850-3_obj_source_left/images', '"../../../etc', 1))


DAMAGED = {
    "cut off PNG": ("dynamic_replica", cut("*.geometric.png"), "expected a whole PNG"),
    "cut off colour": ("tartanair", cut("*_left.png"), "expected a whole image"),
    "cut off JPEG": ("vkitti2", cut("rgb_*.jpg"), "expected a whole image"),
    "cut off EXR": ("matrixcity half", cut("*.exr"), "expected a whole OpenEXR file"),
    "cut off npy": ("tartanair", cut("*_depth.npy"), "expected a whole NumPy file"),
    "cut off npz": ("point_odyssey", cut("anno.npz"), "expected a NumPy archive"),
    "cut off mp4": ("stereo4d", cut("*.mp4"), "*"),
    "cut off HDF5": ("spring", cut("*.dsp5"), "expected a whole HDF5 file"),
    "cut off list": ("dynamic_replica", cut("*.jgz"), "expected a whole gzip file"),
    "cut off track file": ("dynamic_replica", cut("*.pth"), "expected a torch file of tensors"),
    "8 bits of depth": ("vkitti2", eight_bits("depth_*.png"), "expected a PNG of 16 bits"),
    "missing pose": ("tartanair", without_last_line("pose_left.txt"), "4 left images, 3 poses"),
    "missing row": ("vkitti2", without_last_line("extrinsic.txt"), "one row of camera 1"),
    "missing image": ("tartanair", removed("000001_left.png"), "got none of number 1"),
    "missing depth": ("point_odyssey", removed("depth_00002.png"), "got no such file"),
    "missing eye's pose": ("spring", without_last_line("extrinsics.txt"), "expected as many"),
    "pickle in torch": ("dynamic_replica", with_trap_in_torch, "would run code"),
    "pickle in npz": ("point_odyssey", with_trap_in_npz, "arrays of objects would run code"),
    "bomb in PNG": ("vkitti2", bomb_png, "expected a whole PNG"),
    "bomb in npz": ("point_odyssey", bomb_npz, "of a size that the file can hold"),
    "tar that climbs": ("matrixcity half", climbing_tar, "leads outside"),
    "path that climbs": ("dynamic_replica", escaping_path, "expected a path inside"),
    "words for numbers": ("tartanair", text_in("pose_left.txt", "a b c d e f g"), "7 numbers"),
    "NaN pose": ("realestate10k", text_in("*.txt", "https://x\n1 " + "nan " * 18), "finite"),
    "not JSON": ("multicam_video", text_in("*.json", "{"), "expected JSON"),
    "scaled rotation": (
        "realestate10k",
        text_in(
            "*.txt",
            "http://x\n"
            + "\n".join(f"{t} 1 1 .5 .5 0 0 9 0 0 0 0 9 0 0 0 0 9 0" for t in (52553000, 52586367)),
        ),
        "rotations without scale",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_named_error(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    toy_name, damage, says = DAMAGED[name]
    toy = TOYS[toy_name]
    toy.write(toy.truth(), tmp_path)
    damage(tmp_path)
    (tmp_path / "run").mkdir()
    monkeypatch.chdir(tmp_path / "run")
    with pytest.raises(Diff4SplatError) as caught:
        read_clips(toy.dataset, tmp_path)
    text = str(caught.value)
    assert says == "*" or says in text
    assert "\n" not in text and len(text) < 700
    assert not list((tmp_path / "run").iterdir()), "nothing of the file was run"


def test_the_run_goes_on(tmp_path: Path) -> None:
    """Three sequences, one damaged; then repaired and added."""
    root, out = tmp_path / "données réelles", tmp_path / "out"
    truth = TOYS["realestate10k"].truth()
    realestate10k.write(truth, root)
    folder = root / "train"
    for copy in ("1" * 16, "2" * 16):
        shutil.copytree(folder / realestate10k.NAME, folder / copy)
        text = (folder / f"{realestate10k.NAME}.txt").read_text()
        (folder / f"{copy}.txt").write_text(text)
    image = first(folder / ("1" * 16), "*.png")
    whole = image.read_bytes()
    image.write_bytes(whole[:100])
    job = ImportJob(root=root, dataset="realestate10k", folder=out)
    rows = import_dataset(job, Phases())
    assert [row.status for row in rows] == ["written", "failed", "written"]
    assert "2 clips written, 0 present, 1 unusable; the first:" in summary(rows)
    with (out / "report.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert table[1]["error"] == "FileFormatError"
    assert str(image) in table[1]["message"]
    assert len(ClipFolder(out)) == 2
    image.write_bytes(whole)
    again = ImportJob(root=root, dataset="realestate10k", folder=out, append=True)
    assert [row.status for row in import_dataset(again, Phases())] == [
        "present",
        "written",
        "present",
    ]
    assert len(ClipFolder(out)) == 3


def test_nothing_usable_is_an_error(tmp_path: Path) -> None:
    root = realestate10k.write(TOYS["realestate10k"].truth(), tmp_path / "in", poses=1)
    rows = import_dataset(
        ImportJob(root=root, dataset="realestate10k", folder=tmp_path / "out"), Phases()
    )
    with pytest.raises(InputError, match=r"expected usable clips, got none of 1: .*two poses"):
        summary(rows)


def test_another_data_set_is_said(tmp_path: Path) -> None:
    root = spring.write(TOYS["spring"].truth(), tmp_path)
    with pytest.raises(InputError, match=r"expected VKITTI 2.0.3 \(Scene01/clone"):
        read_clips("vkitti2", root)
    with pytest.raises(ConfigError, match="did you mean 'vkitti2'"):
        read_clips("vkitti", root)


def test_names_of_clips_are_plain_and_different() -> None:
    names = ["a/b", "a b", "ä/b", "ö/b", "x" * 300 + "1", "x" * 300 + "2", "a/b/c"]
    found = {clip_identifier("spring", name, 0) for name in names}
    assert len(found) == len(names)
    assert all(len(name) <= 80 and name.isascii() for name in found)


def test_a_list_that_is_not_one(tmp_path: Path) -> None:
    with gzip.open(tmp_path / "frame_annotations_train.jgz", "wt") as stream:
        stream.write('{"a": 1}')
    with pytest.raises(FileFormatError, match="expected a list of frames"):
        read_clips("dynamic_replica", tmp_path)


def test_pickles_are_never_opened(tmp_path: Path) -> None:
    """The format has pickles of instances beside its images; nothing reads them."""
    toy = TOYS["dynamic_replica"]
    toy.write(toy.truth(), tmp_path)
    (tmp_path / "train" / "instance_id_maps.pkl").write_bytes(pickle.dumps(Trap()))
    assert len(read_clips("dynamic_replica", tmp_path)) == 1
    assert not Path("trap-was-run").exists()


def test_a_tar_of_links_holds_no_images(tmp_path: Path) -> None:
    root = matrixcity.write(TOYS["matrixcity half"].truth(), tmp_path)
    folder = first(root, "0000.png").parent
    for image in folder.glob("*.png"):
        image.unlink()
    with tarfile.open(folder / "block_A.tar", "w") as tar:
        link = tarfile.TarInfo("block_A/0000.png")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        tar.addfile(link, io.BytesIO())
    with pytest.raises(FileFormatError, match=r"expected '0000\.png' in it"):
        read_clips("matrixcity", root)
