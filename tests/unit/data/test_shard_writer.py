"""Shards appear whole or not at all, whatever stops the writer."""

import errno
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from oracles_clip_equality import first_difference
from oracles_clips import make_clip

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.codecs.encode import Coding, EncodedClip, encode_clip
from diff4splat.data.manifest import Manifest, write_manifest
from diff4splat.data.shard_file import ShardFile
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import ConfigError, FileFormatError, InputError, OutputError

OPTIONS = ShardOptions(generator="test 1", coding=Coding(depth="float"))
ONE_EACH = replace(OPTIONS, shard_bytes=1)


@pytest.fixture(scope="module")
def encoded() -> list[EncodedClip]:
    return [encode_clip(make_clip(seed=seed), OPTIONS.coding) for seed in range(4)]


def names(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()} if folder.exists() else set()


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def fill(folder: Path, clips: list[EncodedClip], append: bool = False) -> None:
    with ShardWriter(folder, ONE_EACH, append=append) as writer:
        for clip in clips:
            writer.write(clip)


def test_a_full_shard_is_named_at_once(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    size = sum(len(member.content) for member in encoded[0].members)
    with ShardWriter(tmp_path, replace(OPTIONS, shard_bytes=size * 3 // 2)) as writer:
        writer.write(encoded[0])
        assert not (tmp_path / "manifest.json").exists()
        writer.write(encoded[1])
        assert ClipFolder(tmp_path).identifiers == ("clip-0", "clip-1")
        writer.write(encoded[2])
    assert names(tmp_path) == {
        "manifest.json",
        "shard-00000.tar",
        "shard-00000.index.json",
        "shard-00001.tar",
        "shard-00001.index.json",
    }


def test_workers_may_encode(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    with ShardWriter(tmp_path / "a", OPTIONS) as writer:
        writer.write(pickle.loads(pickle.dumps(encoded[0])))
    with ShardWriter(tmp_path / "b", OPTIONS) as writer:
        writer.write(make_clip())
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_nothing_written_leaves_nothing(tmp_path: Path) -> None:
    with ShardWriter(tmp_path / "new", OPTIONS):
        pass
    assert names(tmp_path) == set()


def test_a_folder_with_clips_is_refused(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    fill(tmp_path, encoded[:1])
    before = contents(tmp_path)
    with pytest.raises(OutputError, match=r"expected a folder without clips, .*; append to it or"):
        ShardWriter(tmp_path, OPTIONS)
    assert contents(tmp_path) == before


def test_appending_adds_shards(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    fill(tmp_path / "once", encoded)
    fill(tmp_path / "twice", encoded[:2])
    before = contents(tmp_path / "twice")
    with ShardWriter(tmp_path / "twice", ONE_EACH, append=True) as writer:
        assert writer.identifiers == {"clip-0", "clip-1"}
        for clip in encoded[2:]:
            writer.write(replace(clip, source="another"))
        assert writer.identifiers == {f"clip-{seed}" for seed in range(4)}
    after = contents(tmp_path / "twice")
    assert {n: c for n, c in after.items() if n in before and n != "manifest.json"} == {
        n: c for n, c in before.items() if n != "manifest.json"
    }
    folder = ClipFolder(tmp_path / "twice")
    assert folder.manifest.sources == ("another", "oracle 1")
    folder.check()
    assert first_difference(folder.clip(3), make_clip(seed=3)) is None
    assert names(tmp_path / "twice") == names(tmp_path / "once")


def test_resuming_gives_the_bytes_of_one_run(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    fill(tmp_path / "once", encoded)
    fill(tmp_path / "twice", encoded[:1])
    fill(tmp_path / "twice", encoded[1:], append=True)
    assert contents(tmp_path / "once") == contents(tmp_path / "twice")


@pytest.mark.parametrize("lost", [(), ("shard-00001.index.json",)])
def test_a_shard_that_a_killed_run_did_not_list_is_taken_up(
    tmp_path: Path, encoded: list[EncodedClip], lost: tuple[str, ...]
) -> None:
    fill(tmp_path / "first", encoded[:1])
    for name in ("once", "killed"):
        fill(tmp_path / name, encoded[:2])
    manifest = (tmp_path / "first" / "manifest.json").read_bytes()
    (tmp_path / "killed" / "manifest.json").write_bytes(manifest)
    for name in lost:
        (tmp_path / "killed" / name).unlink()
    fill(tmp_path / "killed", encoded[1:2], append=True)
    assert contents(tmp_path / "once") == contents(tmp_path / "killed")


def test_appending_to_nothing_begins(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    fill(tmp_path, encoded[:1], append=True)
    assert len(ClipFolder(tmp_path)) == 1


def test_appending_to_damage_is_refused(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"manifest\.json: line 1: expected JSON"):
        ShardWriter(tmp_path, OPTIONS, append=True)


def test_files_of_others_are_left_alone(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    (tmp_path / "shard-00000.tar").write_bytes(b"precious")
    (tmp_path / "shard-00001.index.json").write_bytes(b"too")
    fill(tmp_path, encoded[:2])
    assert (tmp_path / "shard-00000.tar").read_bytes() == b"precious"
    assert (tmp_path / "shard-00001.index.json").read_bytes() == b"too"
    assert [s.name for s in ClipFolder(tmp_path).manifest.shards] == [
        "shard-00002.tar",
        "shard-00003.tar",
    ]


def test_the_same_name_twice(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    with ShardWriter(tmp_path, OPTIONS) as writer:
        writer.write(encoded[0])
        with pytest.raises(InputError, match="expected new clips, got 'clip-0' again"):
            writer.write(encoded[0])
        writer.write(encoded[1])
    assert ClipFolder(tmp_path).identifiers == ("clip-0", "clip-1")


def test_an_unusable_clip_costs_only_itself(tmp_path: Path) -> None:
    clip = make_clip()
    with ShardWriter(tmp_path, OPTIONS) as writer:
        with pytest.raises(InputError, match="times_s"):
            writer.write(replace(clip, times_s=-clip.times_s))
        writer.write(clip)
    assert len(ClipFolder(tmp_path)) == 1


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("ours")])
def test_a_stopped_writer_keeps_whole_shards_alone(
    tmp_path: Path, encoded: list[EncodedClip], error: BaseException
) -> None:
    size = sum(len(member.content) for member in encoded[0].members)
    writer = ShardWriter(tmp_path, replace(OPTIONS, shard_bytes=size))
    with pytest.raises(type(error)), writer:
        writer.write(encoded[0])
        writer.write(replace(encoded[1], members=encoded[1].members[:4]))
        raise error
    assert names(tmp_path) == {"manifest.json", "shard-00000.tar", "shard-00000.index.json"}
    ClipFolder(tmp_path).check()


def test_an_interrupt_after_the_manifest_keeps_what_it_lists(
    tmp_path: Path, encoded: list[EncodedClip], monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_then_stop(manifest: Manifest, folder: Path) -> None:
        write_manifest(manifest, folder)
        raise KeyboardInterrupt

    monkeypatch.setattr("diff4splat.data.shard_writer.write_manifest", write_then_stop)
    with pytest.raises(KeyboardInterrupt):
        fill(tmp_path, encoded[:1])
    folder = ClipFolder(tmp_path)
    folder.check()
    assert len(folder) == 1


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "step",
    [
        "diff4splat.data.shard_file._header",
        "diff4splat.data.shard_file.os.replace",
        "diff4splat.data.shard_index.write_text",
        "diff4splat.data.manifest.write_text",
    ],
)
def test_a_full_disk_leaves_what_was_there(
    tmp_path: Path, encoded: list[EncodedClip], monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    fill(tmp_path, encoded[:1])
    before = contents(tmp_path)
    writer = ShardWriter(tmp_path, ONE_EACH, append=True)
    monkeypatch.setattr(step, full_disk)
    with pytest.raises(OutputError, match="the disk is full; free some space") as caught, writer:
        writer.write(encoded[1])
    assert "\n" not in str(caught.value)
    assert contents(tmp_path) == before


def test_a_full_disk_at_the_last_flush(
    tmp_path: Path, encoded: list[EncodedClip], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ShardFile, "close", full_disk)
    with pytest.raises(OutputError, match="the disk is full"), ShardWriter(tmp_path, OPTIONS) as w:
        w.write(encoded[0])
    assert names(tmp_path) == set()


def test_a_writer_that_failed_takes_no_more(
    tmp_path: Path, encoded: list[EncodedClip], monkeypatch: pytest.MonkeyPatch
) -> None:
    with ShardWriter(tmp_path, OPTIONS) as writer:
        with monkeypatch.context() as patched:
            patched.setattr("diff4splat.data.shard_file._header", full_disk)
            with pytest.raises(OutputError):
                writer.write(encoded[0])
        with pytest.raises(OutputError, match="expected a writer in use, got one that stopped"):
            writer.write(encoded[1])
    assert names(tmp_path) == set()


def test_two_writers_of_one_folder(tmp_path: Path, encoded: list[EncodedClip]) -> None:
    slow = ShardWriter(tmp_path, OPTIONS)
    with pytest.raises(OutputError, match="expected to be the only writer"), slow:
        slow.write(encoded[0])
        fill(tmp_path, encoded[1:2])
    assert ClipFolder(tmp_path).identifiers == ("clip-1",)
    assert names(tmp_path) == {"manifest.json", "shard-00000.tar", "shard-00000.index.json"}


def a_file(folder: Path) -> Path:
    folder.write_text("")
    return folder


def a_folder_in_the_way(folder: Path) -> Path:
    (folder / "manifest.json").mkdir(parents=True)
    return folder


@pytest.mark.parametrize("obstacle", [a_file, a_folder_in_the_way])
def test_folders_that_cannot_be_written(
    tmp_path: Path, encoded: list[EncodedClip], obstacle: Callable[[Path], Path]
) -> None:
    folder = obstacle(tmp_path / "a")
    with pytest.raises(OutputError, match="expected to write here, but a f"):
        fill(folder, encoded[:1])


def test_absurd_shard_sizes(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="shard_bytes: expected at least 1, got 0"):
        ShardWriter(tmp_path, replace(OPTIONS, shard_bytes=0))
