"""Parts of clips, and which clips."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import pytest
import torch
from clip_readback import depth_sum
from oracles_clips import make_clip

from diff4splat.data.clip_folder import ClipFolder, Selection
from diff4splat.data.clip_part import ClipPart
from diff4splat.data.codecs.encode import Coding
from diff4splat.data.licenses import commercial_ok
from diff4splat.data.shard_reader import ShardReader
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import InputError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ClipFolder:
    path = tmp_path_factory.mktemp("clips")
    licenses = ("CC0-1.0", "CC BY-NC 4.0", "CC BY 4.0")
    options = ShardOptions(generator="test 1", coding=Coding(depth="float"), shard_bytes=100_000)
    with ShardWriter(path, options) as writer:
        for seed, name in enumerate(licenses):
            clip = make_clip(seed=seed, static=seed == 1)
            writer.write(replace(clip, note=replace(clip.note, license=name)))
    return ClipFolder(path)


def test_it_says_what_it_holds(folder: ClipFolder) -> None:
    assert len(folder) == 3
    assert folder.identifiers == ("clip-0", "clip-1", "clip-2")
    assert [entry.is_static for entry in folder.entries] == [False, True, False]
    assert folder.manifest.sources == ("oracle 1",)
    assert len(folder.manifest.shards) == 2


def test_frames_and_views(folder: ClipFolder) -> None:
    whole = make_clip(seed=2)
    part = folder.clip(2, ClipPart(frames=(1, 2, 3), views=(1, 0)))
    assert torch.equal(part.times_s, whole.times_s[1:4])
    for mine, theirs in zip(part.views, whole.views[::-1], strict=True):
        assert torch.equal(mine.rgb, theirs.rgb[1:4])
        assert torch.equal(mine.depth, theirs.depth[1:4])
        assert torch.equal(mine.instances, theirs.instances[1:4])
        assert torch.equal(mine.cameras.world_from_camera, theirs.cameras.world_from_camera[1:4])
        assert torch.equal(mine.flow.to_next, theirs.flow.to_next[1:3])
        assert torch.equal(mine.track_uv, theirs.track_uv[1:4])
    assert torch.equal(part.tracks.positions, whole.tracks.positions[1:4])


def test_found_at_counts_within_the_part(folder: ClipFolder) -> None:
    part = folder.clip(0, ClipPart(frames=(1, 2, 3), views=(1,)))
    for mine, (view, frame) in zip(
        part.tracks.found_at.tolist(), make_clip().tracks.found_at.tolist(), strict=True
    ):
        assert mine == ([0, frame - 1] if view == 1 and 1 <= frame <= 3 else [-1, -1])
    assert {0, -1} <= set(part.tracks.found_at[:, 0].tolist())


def test_scattered_frames_have_no_flow(folder: ClipFolder) -> None:
    part = folder.clip(0, ClipPart(frames=(0, 4), flow=False))
    assert torch.equal(part.views[1].depth, make_clip().views[1].depth[[0, 4]])
    assert part.views[0].flow is None
    one = folder.clip(0, ClipPart(frames=(3,)))
    assert one.views[0].flow.to_next.shape == (0, 24, 32, 2)


def test_what_is_not_wanted_is_not_read(
    folder: ClipFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    read = ShardReader.read

    def listen(self, identifier, suffixes, verify=True):
        asked.extend(suffixes)
        return read(self, identifier, suffixes, verify)

    monkeypatch.setattr(ShardReader, "read", listen)
    part = folder.clip(1, ClipPart(views=(1,), flow=False, instances=False, tracks=False))
    assert sorted(asked) == ["camera.npz", "depth01.exr", "meta.json", "rgb01.png"]
    assert part.tracks is part.views[0].flow is part.views[0].instances is None


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (ClipPart(frames=()), "frames: expected one or more of 0 to 4, got ()"),
        (ClipPart(frames=(5,)), "frames: expected one or more of 0 to 4, got (5,)"),
        (ClipPart(frames=(-1,)), "frames: expected one or more of 0 to 4, got (-1,)"),
        (ClipPart(frames=(2, 1), flow=False), "expected increasing numbers, got (2, 1)"),
        (ClipPart(frames=(0, 2)), "expected neighbours where flow is read, got (0, 2)"),
        (ClipPart(views=(2,)), "views: expected one or more of 0 to 1, got (2,)"),
        (ClipPart(views=(0, 0)), "views: expected each at most once, got (0, 0)"),
    ],
)
def test_impossible_parts(folder: ClipFolder, part: ClipPart, says: str) -> None:
    with pytest.raises(InputError) as caught:
        folder.clip(0, part)
    assert says in str(caught.value)


@pytest.mark.parametrize("position", [-1, 3])
def test_impossible_positions(folder: ClipFolder, position: int) -> None:
    with pytest.raises(InputError, match=f"position: expected 0 to 2, got {position}"):
        folder.clip(position)


def test_selections(folder: ClipFolder) -> None:
    assert folder.positions(Selection()) == (0, 1, 2)
    assert folder.positions(Selection(commercial_only=True)) == (0, 2)
    assert folder.positions(Selection(is_static=True)) == (1,)
    assert folder.positions(Selection(is_static=False)) == (0, 2)
    assert folder.positions(Selection(identifiers=["clip-2", "clip-1"])) == (1, 2)
    with pytest.raises(InputError, match="expected a clip 'clip-9', got a set without it"):
        folder.positions(Selection(identifiers={"clip-9"}))


@pytest.mark.parametrize("name", ["CC0-1.0", "cc by 4.0", "Apache-2.0", " MIT ", "CC BY-SA 4.0"])
def test_free_licences(name: str) -> None:
    assert commercial_ok(name)


@pytest.mark.parametrize("name", ["", "CC BY-NC 4.0", "CC-BY-NC-SA-3.0", "unknown", "MIT-like"])
def test_other_licences(name: str) -> None:
    assert not commercial_ok(name)


@pytest.mark.slow
def test_other_processes_read_it(folder: ClipFolder) -> None:
    # Started afresh: a fork of a process with threads may hang in whatever a thread was holding.
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        sums = list(pool.map(depth_sum, [folder] * 3, range(3), timeout=300))
    assert sums == [depth_sum(folder, position) for position in range(3)]
