"""Every kind of damage is one line that names the file; nothing outside the folder is touched."""

import io
import json
import os
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles_clips import make_clip
from PIL import Image

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.codecs.depth import decode_exr, encode_exr
from diff4splat.data.codecs.encode import EncodedClip, Member, encode_clip
from diff4splat.data.codecs.images import decode_png
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError

TAR, INDEX, MANIFEST = "shard-00000.tar", "shard-00000.index.json", "manifest.json"


@pytest.fixture(scope="module")
def encoded() -> EncodedClip:
    return encode_clip(make_clip())


@pytest.fixture
def folder(tmp_path: Path, encoded: EncodedClip) -> Path:
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")) as writer:
        writer.write(encoded)
    return tmp_path


def message(folder: Path, verify: bool = True) -> str:
    with pytest.raises(FileFormatError) as caught:
        ClipFolder(folder, verify).clip(0)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(folder))
    return str(caught.value)


def edit(file: Path, change: Callable[[Any], object]) -> None:
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (TAR, "shard-00000.tar: expected a shard of"),
        (INDEX, "shard-00000.index.json: expected a diff4splat-shard-index file, got no such"),
        (MANIFEST, "manifest.json: expected a diff4splat-clips file, got no such file"),
    ],
)
def test_missing_files(folder: Path, name: str, says: str) -> None:
    (folder / name).unlink()
    assert says in message(folder)


@pytest.mark.parametrize("name", [TAR, INDEX, MANIFEST])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_cut_off_files(folder: Path, name: str, share: float) -> None:
    content = (folder / name).read_bytes()
    (folder / name).write_bytes(content[: int(len(content) * share)])
    assert name in message(folder)


def test_a_shard_that_shrinks_after_opening(folder: Path) -> None:
    opened = ClipFolder(folder)
    opened.clip(0)
    (folder / TAR).write_bytes((folder / TAR).read_bytes()[:2000])
    with pytest.raises(FileFormatError, match=r"the shard is damaged, copy it again"):
        opened.clip(0)
    (folder / TAR).unlink()
    with pytest.raises(FileFormatError, match=r"expected to read clip 'clip-0', got 'No such file"):
        opened.clip(0)


def test_every_flipped_byte_of_a_member_is_noticed(folder: Path) -> None:
    index = json.loads((folder / INDEX).read_text())["clips"]["clip-0"]
    content = (folder / TAR).read_bytes()
    for suffix, (offset, size, _) in index.items():
        damaged = bytearray(content)
        damaged[offset + size // 2] ^= 0x10
        (folder / TAR).write_bytes(damaged)
        assert f"clip 'clip-0', '{suffix}': expected {size} bytes with checksum" in message(folder)
        with pytest.raises(FileFormatError, match="the shard is damaged"):
            ClipFolder(folder, verify=False).check()


def shards(change: Callable[[dict[str, Any]], object]) -> Callable[[Any], object]:
    return lambda document: change(document["shards"][0])


def clip_of(change: dict[str, object]) -> Callable[[Any], object]:
    return shards(lambda shard: shard["clips"][0].update(change))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.update(format="other"), "expected a diff4splat-clips, got JSON of another"),
        (lambda d: d.update(version=3), "expected version 1 to 2, got 3; read it with the"),
        (lambda d: d.update(version=True), "'version': expected a whole number, got True"),
        (lambda d: d.pop("shards"), "'shards': expected a list, got nothing"),
        (lambda d: d.update(shards=[1]), "'shards': expected a list of objects"),
        (lambda d: d.update(sources=[1]), "'sources': expected a list of texts"),
        (lambda d: d["shards"].append(d["shards"][0]), "every shard once, got 'shard-00000.tar'"),
        (shards(lambda s: s.update(name="../x.tar")), "expected a shard like 'shard-00000.tar'"),
        (shards(lambda s: s.update(name="/etc/x.tar")), "expected a shard like"),
        (shards(lambda s: s.update(name="a\n.tar")), "expected a shard like"),
        (
            shards(lambda s: s.update(clips=s["clips"] * 2, count=2)),
            "every clip once, got 'clip-0'",
        ),
        (shards(lambda s: s.update(count=2)), "expected 2 clips by its count, got 1"),
        (shards(lambda s: s.update(size=-1)), "'size': expected a whole number, got -1"),
        (shards(lambda s: s.update(size=7)), "expected a shard of 7 bytes, got"),
        (clip_of({"id": "../../etc"}), "expected up to 80 letters, digits, '_' and '-'"),
        (clip_of({"id": "a.b"}), "expected up to 80 letters"),
        (clip_of({"id": "a" * 81}), "expected up to 80 letters"),
        (clip_of({"id": "absent"}), "expected the same clips in manifest and index, got 'absent'"),
        (clip_of({"frames": 0}), "'frames': expected 1 to 10000, got 0"),
        (clip_of({"frames": 10**9}), "'frames': expected 1 to 10000, got 1000000000"),
        (clip_of({"frames": 1.5}), "'frames': expected a whole number, got 1.5"),
        (clip_of({"views": 101}), "'views': expected 1 to 100, got 101"),
        (clip_of({"tracks": 10**8}), "'tracks': expected 0 to 10000000, got 100000000"),
        (clip_of({"size_px": [24]}), "'size_px': expected height and width from 1 to 16384"),
        (clip_of({"size_px": [24, 10**6]}), "'size_px': expected height and width"),
        (clip_of({"size_px": [24, True]}), "'size_px': expected height and width"),
        (clip_of({"static": "no"}), "'static': expected true or false, got 'no'"),
        (clip_of({"license": None}), "'license': expected text, got nothing"),
        (clip_of({"frames": 6}), "'meta.json': expected the clip of the manifest"),
        (clip_of({"license": "MIT"}), "manifest and shard are of different sets"),
    ],
)
def test_wrong_manifests(folder: Path, change: Callable[[Any], object], says: str) -> None:
    edit(folder / MANIFEST, change)
    assert says in message(folder)


def slot(*values: object) -> Callable[[Any], object]:
    return lambda document: document["clips"]["clip-0"].update({"meta.json": list(values)})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.update(version=0), "expected version 1 to 2, got 0"),
        (lambda d: d.update(shard="b.tar"), "expected the index of shard-00000.tar, got that of"),
        (lambda d: d.update(clips=[]), "'clips': expected an object, got []"),
        (lambda d: d.update(clips={"clip-0": 1}), "'clips': expected an object of objects"),
        (lambda d: d.update(clips={}), "expected the same clips in manifest and index"),
        (lambda d: d["clips"].update({"../a": {}}), "expected plain names of clips, got '../a'"),
        (lambda d: d["clips"]["clip-0"].update({"../a.png": [512, 1, 0]}), "members like 'rgb00"),
        (lambda d: d["clips"]["clip-0"].pop("camera.npz"), "'camera.npz': expected this member"),
        (lambda d: d["clips"]["clip-0"].pop("depth01.exr"), "'depth01.exr': expected this member"),
        (lambda d: d["clips"]["clip-0"].pop("rgb00.png"), "'rgb00.png': expected this member"),
        (slot(512), "expected [offset, size, crc32], got [512]"),
        (slot(512, -1, 0), "expected [offset, size, crc32], got [512, -1, 0]"),
        (slot(512, 1.0, 0), "expected [offset, size, crc32]"),
        (slot(512, 1 << 60, 0), "expected members within the"),
        (slot(512 << 20, 1, 0), "expected members within the"),
        (slot(0, 1, 0), "expected members within the"),
        (slot(513, 1, 0), "expected members within the"),
        (slot(512, 10, 0), "expected 10 bytes with checksum 00000000"),
    ],
)
def test_wrong_indices(folder: Path, change: Callable[[Any], object], says: str) -> None:
    edit(folder / INDEX, change)
    assert says in message(folder)


@pytest.mark.parametrize("text", ["", "[]", "null", "{" * 100_000, "\xff", '{"format": 1}'])
@pytest.mark.parametrize("name", [INDEX, MANIFEST])
def test_files_that_are_something_else(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, encoding="latin-1")
    assert name in message(folder)


def npz(**arrays: np.ndarray) -> bytes:
    packed = io.BytesIO()
    np.savez(packed, allow_pickle=True, **arrays)
    return packed.getvalue()


def camera(**changed: np.ndarray) -> bytes:
    clip = make_clip()
    names = ("focal_px", "center_px", "world_from_camera")
    arrays = {n: np.stack([getattr(v.cameras, n) for v in clip.views]) for n in names}
    return npz(**(arrays | {"times_s": clip.times_s.numpy()} | changed))


def png(shape: tuple[int, ...]) -> bytes:
    written = io.BytesIO()
    Image.fromarray(np.zeros(shape, np.uint8)).save(written, "PNG")
    return written.getvalue()


def bomb() -> bytes:
    """The right headers, and a million zeros more than the last one says."""
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(camera())) as fine,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name in fine.namelist():
            more = 10**6 if name == "times_s.npy" else 0
            archive.writestr(name, fine.read(name) + bytes(more))
    return packed.getvalue()


MIRRORED = np.broadcast_to(np.diag([1.0, 1.0, -1.0, 1.0]), (2, 5, 4, 4))
NOWHERE = np.full((2, 5, 4, 4), np.nan)


@pytest.mark.parametrize(
    ("suffix", "content", "says"),
    [
        ("camera.npz", b"", "expected a NumPy archive, got a damaged or other file"),
        ("camera.npz", npz(), "expected the array 'focal_px', got an archive without it"),
        (
            "camera.npz",
            camera(focal_px=np.ones((2, 5, 2), "f4")),
            "expected float64 of shape (2, 5",
        ),
        (
            "camera.npz",
            camera(times_s=np.arange(6.0)),
            "expected float64 of shape (5,), got float64",
        ),
        (
            "camera.npz",
            camera(times_s=np.array([{}] * 5)),
            "expected the header of an array of numbers",
        ),
        ("camera.npz", camera(times_s=np.zeros(5)), "as stored, clip 'clip-0', times_s: expected"),
        ("camera.npz", camera(world_from_camera=NOWHERE), "cameras: expected finite numbers"),
        ("camera.npz", camera(world_from_camera=MIRRORED), "expected right-handed rotations"),
        ("camera.npz", camera(focal_px=-np.ones((2, 5, 2))), "focal lengths above 0"),
        ("camera.npz", camera(focal_px=np.full((2, 5, 2), np.inf)), "expected finite intrinsics"),
        ("camera.npz", bomb(), "expected a whole array 'times_s', got a damaged one"),
        ("rgb00.png", b"\x89PNG", "expected a PNG, got a damaged or other file"),
        ("rgb00.png", png((24, 32, 3)), "expected a PNG of 5 frames, (height, width) (120, 32)"),
        ("rgb00.png", png((120, 32)), "mode RGB, got (120, 32) and L"),
        ("rgb01.png", png((120, 33, 3)), "got (120, 33) and RGB"),
        ("instances00.png", png((120, 32, 3)), "mode L, got (120, 32) and RGB"),
        ("depth00.exr", b"v/1\x01", "expected an OpenEXR file, got a damaged or other one"),
        ("flow00.npz", npz(to_next=np.zeros((5, 24, 32, 2), "f4")), "shape (4, 24, 32, 2), got"),
        ("tracks.npz", npz(positions=np.zeros((5, 17, 3), "f4")), "shape (5, 16, 3), got float32"),
        ("meta.json", b"{}", "'meta.json': expected a diff4splat-clip, got JSON of another kind"),
        ("meta.json", b"\xff", "'meta.json': expected JSON in UTF-8"),
    ],
)
def test_forged_members(
    tmp_path: Path, encoded: EncodedClip, suffix: str, content: bytes, says: str
) -> None:
    """With right checksums: only the decoders stand between the file and the training."""
    text = message(forged(tmp_path, encoded, suffix, content))
    assert says in text
    assert "clip 'clip-0'" in text


def forged(folder: Path, encoded: EncodedClip, suffix: str, content: bytes) -> Path:
    members = tuple(
        Member(suffix=suffix, content=content) if member.suffix == suffix else member
        for member in encoded.members
    )
    with ShardWriter(folder, ShardOptions(generator="test 1")) as writer:
        writer.write(replace(encoded, members=members))
    return folder


@pytest.mark.parametrize("suffix", ["depth00.exr", "rgb00.png", "camera.npz", "flow00.npz"])
def test_damage_without_checksums(tmp_path: Path, encoded: EncodedClip, suffix: str) -> None:
    """Cut off or flipped, the decoders themselves notice."""
    content = next(member.content for member in encoded.members if member.suffix == suffix)
    folder = forged(tmp_path, encoded, suffix, content[: len(content) // 2])
    assert f"'{suffix}': expected" in message(folder, verify=False)


def test_other_lengths_and_sizes_of_depth(tmp_path: Path, encoded: EncodedClip) -> None:
    for number, other in enumerate((make_clip(frames=4), make_clip(size_px=(24, 33)))):
        content = next(m.content for m in encode_clip(other).members if m.suffix == "depth00.exr")
        folder = forged(tmp_path / str(number), encoded, "depth00.exr", content)
        assert "expected depth of 5 frames of (height, width) (24, 32), got" in message(folder)


def test_an_image_that_claims_to_be_enormous(tmp_path: Path, encoded: EncodedClip) -> None:
    header = bytearray(next(m.content for m in encoded.members if m.suffix == "rgb00.png"))
    header[16:24] = (60_000).to_bytes(4, "big") * 2
    folder = forged(tmp_path, encoded, "rgb00.png", bytes(header))
    assert "'rgb00.png': expected a PNG" in message(folder)


def test_depth_that_claims_to_be_enormous(tmp_path: Path, encoded: EncodedClip) -> None:
    """Refused by its header, before anything of that size is asked for."""
    content = next(m.content for m in encoded.members if m.suffix == "depth00.exr")
    window = struct.pack("<4i", 0, 0, 31, 23)
    assert content.count(window) >= 5
    wide = content.replace(window, struct.pack("<4i", 0, 0, 29_999, 29_999))
    text = message(forged(tmp_path, encoded, "depth00.exr", wide))
    assert "frames of (height, width) (24, 32), got 5 of [(30000, 30000)]" in text


def test_tracks_found_in_frames_that_do_not_exist(tmp_path: Path, encoded: EncodedClip) -> None:
    content = next(m.content for m in encoded.members if m.suffix == "tracks.npz")
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays = dict(stored)
    for bad in (5, -2, 2**31 - 1):
        arrays["found_at"] = np.full((16, 2), bad, np.int32)
        folder = forged(tmp_path / str(bad), encoded, "tracks.npz", npz(**arrays))
        assert f"expected views below 2 and frames below 5, got [{bad}, {bad}]" in message(folder)


def test_an_index_that_gives_gigabytes_to_one_member(folder: Path) -> None:
    """A file with a hole costs nothing on the disk, and everything in memory."""
    size = 60 << 30
    os.truncate(folder / TAR, size)
    edit(folder / MANIFEST, lambda document: document["shards"][0].update(size=size))
    places = {"depth00.exr": [512, size - 512, 0]}
    edit(folder / INDEX, lambda document: document["clips"]["clip-0"].update(places))
    assert "'depth00.exr': expected up to" in message(folder)


def test_pixels_that_no_file_of_this_size_can_hold() -> None:
    for decode, content in ((decode_png, _png()), (decode_exr, _exr())):
        with pytest.raises(FileFormatError, match="damaged or other"):
            decode(content, (10_000, 16_384, 16_384))


def _png() -> bytes:
    """One that claims the size above, and holds nothing."""
    header = struct.pack(">IIBBBBB", 16_384, 10_000 * 16_384, 8, 0, 0, 0, 0)
    chunk = b"IHDR" + header
    return (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    )


def _exr() -> bytes:
    return encode_exr(np.ones((1, 4, 4), np.float32), "float")
