"""Shards of clips, and the members of a clip behind their checksums."""

from pathlib import Path

from clip_shards import write_shards
from oracles_clips import make_clip

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import FULL_CLIP
from diff4splat.data.codecs.decode import decode_clip
from diff4splat.data.codecs.encode import Coding, encode_clip
from diff4splat.data.entry import entry_of
from fuzz.reader import Reader


def _write(folder: Path) -> None:
    write_shards(folder, still=1, moving=1)


def _read(folder: Path) -> None:
    clips = ClipFolder(folder)
    for position in range(len(clips)):
        clips.clip(position)


def _clip():
    return make_clip(3, (16, 16), views=1, seed=0, tracks=4)


def _write_members(folder: Path) -> None:
    for coding, name in ((Coding(), "png"), (Coding(images="mp4"), "mp4")):
        for member in encode_clip(_clip(), coding).members:
            if name == "png" or member.suffix.endswith("mp4"):
                (folder / member.suffix).write_bytes(member.content)


def _read_members(folder: Path) -> None:
    members = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    entry = entry_of(_clip())
    still = {name: content for name, content in members.items() if not name.endswith("mp4")}
    decode_clip(members, entry, FULL_CLIP)
    decode_clip(still, entry, FULL_CLIP)


CLIPS = {
    "clip shards": Reader(make=_write, read=_read),
    "clip members": Reader(make=_write_members, read=_read_members),
}
