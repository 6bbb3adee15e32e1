"""Whatever is written: tar, index and manifest say the same, and every byte comes back."""

import tarfile
import tempfile
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.data.codecs.encode import EncodedClip, Member
from diff4splat.data.entry import ClipEntry
from diff4splat.data.json_fields import IDENTIFIER
from diff4splat.data.manifest import read_manifest
from diff4splat.data.shard_reader import ShardReader
from diff4splat.data.shard_writer import ShardOptions, ShardWriter

identifiers = st.from_regex(IDENTIFIER, fullmatch=True)
suffixes = st.from_regex(r"[a-z]{1,9}[0-9]{0,2}\.(png|npz|exr|json|mp4)", fullmatch=True)
bodies = st.one_of(
    st.binary(max_size=40), st.sampled_from([0, 511, 512, 513, 1024, 10240]).map(bytes)
)
text = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


plain_clips = st.fixed_dictionaries(
    {
        "identifier": identifiers,
        "frames": st.integers(1, 10_000),
        "size_px": st.tuples(st.integers(1, 16384), st.integers(1, 16384)),
        "views": st.integers(1, 100),
        "tracks": st.integers(0, 10_000_000),
        "is_static": st.booleans(),
        "license": text,
        "source": text,
        "members": st.dictionaries(suffixes, bodies, max_size=5),
    }
)
clip_lists = st.lists(plain_clips, min_size=1, max_size=5, unique_by=lambda c: c["identifier"])


def encoded(plain: dict[str, Any]) -> EncodedClip:
    members = plain.pop("members")
    return EncodedClip(
        source=plain.pop("source"),
        entry=ClipEntry(**plain),
        members=tuple(Member(suffix=name, content=body) for name, body in members.items()),
    )


@settings(max_examples=25, deadline=None)
@given(plain=clip_lists, shard_bytes=st.integers(1, 20_000), stop=st.integers(0, 5))
def test_tar_index_and_manifest_agree(
    plain: list[dict[str, Any]], shard_bytes: int, stop: int
) -> None:
    clips = [encoded(each) for each in plain]
    options = ShardOptions(generator="test 1", shard_bytes=shard_bytes)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in (clips[:stop], clips[stop:]):
            with ShardWriter(folder, options, append=True) as writer:
                for clip in part:
                    writer.write(clip)
        manifest = read_manifest(folder)
        assert manifest.clips == tuple(clip.entry for clip in clips)
        assert set(manifest.sources) == {clip.source for clip in clips}
        by_name = {clip.entry.identifier: clip for clip in clips}
        for shard in manifest.shards:
            own = [by_name[entry.identifier] for entry in shard.clips]
            reader = ShardReader(folder, shard)
            with tarfile.open(folder / shard.name, "r:") as tar:
                infos = tar.getmembers()
            expected = [(c.entry.identifier, m.suffix, m.content) for c in own for m in c.members]
            assert [info.name for info in infos] == [f"{i}.{s}" for i, s, _ in expected]
            for info, (identifier, suffix, content) in zip(infos, expected, strict=True):
                slot = reader.slots(identifier)[suffix]
                assert (slot.offset, slot.size) == (info.offset_data, info.size)
                assert reader.read(identifier, [suffix]) == {suffix: content}
                assert (info.mtime, info.uid, info.gid, info.uname) == (0, 0, 0, "")
            assert shard.size % tarfile.RECORDSIZE == 0
