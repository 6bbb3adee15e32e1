"""A clip comes back from a shard as it went in, by our reader and by anybody's."""

import io
import json
import tarfile
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch
from oracles_clip_equality import first_difference
from oracles_clips import make_clip
from PIL import Image

from diff4splat.data.clip import Clip, Tracks
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.data.codecs.depth import decode_npy, encode_npy
from diff4splat.data.codecs.encode import Coding, Member, encode_clip
from diff4splat.data.codecs.images import decode_jpeg, encode_jpeg
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError, InputError

PXR24_ERROR = 2.0**-16
PLAIN = Coding(images="jpeg", depth="half_plain")


def stored(folder: Path, clip: Clip, coding: Coding | None = None) -> Clip:
    options = ShardOptions(generator="test 1", coding=coding or Coding())
    with ShardWriter(folder, options) as writer:
        writer.write(clip)
    return ClipFolder(folder).clip(0)


@pytest.mark.parametrize(
    "clip",
    [
        make_clip(),
        make_clip(frames=1, size_px=(7, 9), views=1, tracks=0, seed=1),
        make_clip(static=True, views=3, size_px=(9, 31), seed=2),
    ],
    ids=lambda clip: clip.note.identifier,
)
def test_bit_exact_without_depth_loss(tmp_path: Path, clip: Clip) -> None:
    assert first_difference(stored(tmp_path, clip, Coding(depth="float")), clip) is None


def test_pxr24_rounds_depth_alone(tmp_path: Path) -> None:
    clip = make_clip()
    back = stored(tmp_path, clip)
    for one, other in zip(back.views, clip.views, strict=True):
        assert ((one.depth - other.depth).abs() <= PXR24_ERROR * other.depth).all()
        assert ((one.depth == 0) == (other.depth == 0)).all(), "sky stays sky"
    views = [replace(b, depth=c.depth) for b, c in zip(back.views, clip.views, strict=True)]
    assert first_difference(replace(back, views=tuple(views)), clip) is None


def test_half_precision_depth(tmp_path: Path) -> None:
    clip = make_clip(views=1)
    depth = stored(tmp_path, clip, Coding(depth="half")).views[0].depth
    assert depth.dtype == torch.float32
    assert torch.equal(depth, clip.views[0].depth.half().float())


@pytest.mark.parametrize("value", [1e-6, 7e4])
def test_half_precision_refuses_what_it_cannot_hold(value: float) -> None:
    clip = make_clip(views=1)
    far = replace(clip.views[0], depth=torch.full_like(clip.views[0].depth, value))
    with pytest.raises(InputError, match=r"clip 'clip-0': depth: expected .* half precision"):
        encode_clip(replace(clip, views=(far,)), Coding(depth="half"))


def test_jpeg_images_and_plain_half_depth(tmp_path: Path) -> None:
    clip = make_clip(views=1, size_px=(25, 33))
    view = stored(tmp_path, clip, PLAIN).views[0]
    assert (view.rgb.float() - clip.views[0].rgb.float()).abs().mean() < 3
    assert torch.equal(view.depth, clip.views[0].depth.half().float())


def test_plain_depth_of_some_frames_alone(tmp_path: Path) -> None:
    clip = make_clip(views=1, tracks=12)
    with ShardWriter(tmp_path, ShardOptions(generator="t", coding=PLAIN)) as writer:
        writer.write(clip)
    found = ClipFolder(tmp_path).clip(0, ClipPart(frames=(1, 2, 3), flow=False))
    assert torch.equal(found.views[0].depth, clip.views[0].depth[1:4].half().float())
    assert torch.equal(found.tracks.positions, clip.tracks.positions[1:4])


@pytest.mark.parametrize("kept", [0, 5, 60, 128, 1000, -1])
def test_damaged_plain_depth_is_refused(kept: int) -> None:
    content = encode_npy(np.ones((3, 20, 20), np.float32))
    with pytest.raises(FileFormatError, match="expected"):
        decode_npy(content[:kept], (3, 20, 20), range(3))
    with pytest.raises(FileFormatError, match=r"shape \(3, 20, 21\), got float16"):
        decode_npy(content, (3, 20, 21), range(3))
    with pytest.raises(InputError, match="half precision"):
        encode_npy(np.full((1, 2, 2), 1e-6, np.float32))


def test_jpeg_has_no_room_for_many_rows() -> None:
    with pytest.raises(InputError, match="expected at most 65500 rows"):
        encode_jpeg(np.zeros((66, 1000, 2, 3), np.uint8))


@pytest.mark.parametrize("content", [b"", b"no", b"\xff\xd8\xff\xe0 damaged"])
def test_damaged_jpeg_is_refused(content: bytes) -> None:
    with pytest.raises(FileFormatError, match="expected a JPEG"):
        decode_jpeg(content, (1, 2, 2, 3))


@pytest.mark.parametrize("size_px", [(24, 32), (25, 33)])
def test_mp4_images(tmp_path: Path, size_px: tuple[int, int]) -> None:
    clip = make_clip(views=1, size_px=size_px)
    rgb = stored(tmp_path, clip, Coding(images="mp4")).views[0].rgb
    assert rgb.shape == clip.views[0].rgb.shape
    error = (rgb.float() - clip.views[0].rgb.float()).abs().mean()
    mirrored = (rgb.flip(-1).float() - clip.views[0].rgb.float()).abs().mean()
    assert error < 12, "frames and colours in their order"
    assert error < mirrored


def test_views_may_leave_out_what_they_do_not_know(tmp_path: Path) -> None:
    clip = make_clip()
    bare = replace(clip.views[1], instances=None, flow=None, track_uv=None, track_visible=None)
    clip = replace(clip, views=(clip.views[0], bare))
    assert first_difference(stored(tmp_path, clip, Coding(depth="float")), clip) is None


def test_no_points_are_no_tracks(tmp_path: Path) -> None:
    clip = make_clip(tracks=0)
    nothing = Tracks(
        positions=torch.zeros(5, 0, 3),
        instances=torch.zeros(0, dtype=torch.uint8),
        found_at=torch.zeros(0, 2, dtype=torch.int64),
    )
    assert stored(tmp_path, replace(clip, tracks=nothing)).tracks is None


def test_equal_clips_give_equal_bytes(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        stored(tmp_path / folder, make_clip())
    one, other = ({f.name: f.read_bytes() for f in (tmp_path / n).iterdir()} for n in "ab")
    assert one == other


def test_pythons_tarfile_reads_it_in_webdataset_order(tmp_path: Path) -> None:
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")) as writer:
        for seed in range(3):
            writer.write(make_clip(seed=seed))
    with tarfile.open(tmp_path / "shard-00000.tar", "r:") as tar:
        names = tar.getnames()
        keys = [name.split(".")[0] for name in names]
        assert keys == sorted(keys), "members of one clip are neighbours"
        index = json.loads((tmp_path / "shard-00000.index.json").read_text())["clips"]
        for info in tar.getmembers():
            identifier, suffix = info.name.split(".", 1)
            assert index[identifier][suffix][:2] == [info.offset_data, info.size]
    assert len(names) == len(set(names)) == 3 * (3 + 2 * 4)


def test_the_archive_ends_even_where_its_records_are_full(tmp_path: Path) -> None:
    encoded = encode_clip(make_clip())
    full = replace(encoded, members=(Member(suffix="meta.json", content=bytes(9728)),))
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")) as writer:
        writer.write(full)
    content = (tmp_path / "shard-00000.tar").read_bytes()
    assert len(content) == 2 * tarfile.RECORDSIZE
    assert not any(content[-1024:])


def test_every_member_opens_without_us(tmp_path: Path) -> None:
    clip = make_clip()
    stored(tmp_path, clip)
    with tarfile.open(tmp_path / "shard-00000.tar") as tar:
        members = {m.name.split(".", 1)[1]: tar.extractfile(m).read() for m in tar.getmembers()}
    with zipfile.ZipFile(io.BytesIO(members["tracks.npz"])) as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    image = Image.open(io.BytesIO(members["rgb00.png"]))
    assert np.array_equal(np.array(image), clip.views[0].rgb.reshape(-1, 32, 3))
    with np.load(io.BytesIO(members["camera.npz"]), allow_pickle=False) as camera:
        assert np.array_equal(
            camera["world_from_camera"][1], clip.views[1].cameras.world_from_camera
        )
    with np.load(io.BytesIO(members["flow01.npz"]), allow_pickle=False) as flow:
        known = np.unpackbits(flow["known"], count=4 * 24 * 32).reshape(4, 24, 32)
        assert np.array_equal(known, clip.views[1].flow.known)
    with OpenEXR.File(io.BytesIO(members["depth00.exr"]), separate_channels=True) as depth:
        assert [part.name() for part in depth.parts] == [f"frame_{i:04d}" for i in range(5)]
    assert json.loads(members["meta.json"])["caption"] == clip.note.caption
