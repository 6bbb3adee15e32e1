"""Clips out of a folder of shards, in any order, from any process.

No file stays open between two reads, so that a folder can be sent to, or inherited by, as many
worker processes as wanted. Reading one clip is one open and one seek per member.
"""

import hashlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.checks import require_valid_clip
from diff4splat.data.clip import Clip
from diff4splat.data.clip_part import FULL_CLIP, ClipPart
from diff4splat.data.codecs.decode import decode_clip, wanted_members
from diff4splat.data.codecs.encode import EncodedClip, Member
from diff4splat.data.codecs.metadata import decode_metadata
from diff4splat.data.entry import ClipEntry
from diff4splat.data.licenses import commercial_ok
from diff4splat.data.manifest import Manifest, read_manifest
from diff4splat.data.shard_reader import ShardReader
from diff4splat.errors import FileFormatError, InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Which clips are wanted; None and False do not restrict."""

    commercial_only: bool = False
    """Leave out every licence not known to allow commercial use."""
    is_static: bool | None = None
    identifiers: Collection[str] | None = None


class ClipFolder:
    """A sequence of clips; positions count from 0 in the order of the manifest."""

    def __init__(self, folder: Path | str, verify: bool = True) -> None:
        """Read the manifest and look whether every shard is there.

        ``verify`` compares checksums of all that is read and checks every clip against its
        contract; without it, damage may show late, as other errors or as wrong pixels.

        Raises:
            FileFormatError: no manifest or a damaged one; a shard is missing or cut off.
        """
        self._folder, self._verify = Path(folder), verify
        self.manifest: Manifest = read_manifest(self._folder)
        self._places: list[tuple[ShardReader, ClipEntry]] = []
        for shard in self.manifest.shards:
            reader = ShardReader(self._folder, shard)
            self._places += [(reader, entry) for entry in shard.clips]

    @property
    def entries(self) -> tuple[ClipEntry, ...]:
        """Sizes and rights of every clip, without reading any."""
        return tuple(entry for _, entry in self._places)

    @property
    def identifiers(self) -> tuple[str, ...]:
        """Names of the clips by position."""
        return tuple(entry.identifier for _, entry in self._places)

    def __len__(self) -> int:
        return len(self._places)

    def spread(self, most: int | None = None) -> tuple[int, ...]:
        """Positions of up to ``most`` clips, evenly from the first to the last; None is all."""
        last = len(self) - 1
        count = last + 1 if most is None else min(most, last + 1)
        return tuple(round(place * last / max(count - 1, 1)) for place in range(count))

    def positions(self, selection: Selection) -> tuple[int, ...]:
        """Where the wanted clips are, in order.

        Raises:
            InputError: an identifier is asked for that the folder lacks.
        """
        wanted = None if selection.identifiers is None else set(selection.identifiers)
        lacking = sorted((wanted or set()) - set(self.identifiers))
        if lacking:
            raise InputError(
                f"{self._folder}: expected a clip '{lacking[0]}', got a set without it; "
                "check the name and the folder"
            )
        return tuple(
            position
            for position, entry in enumerate(self.entries)
            if (not selection.commercial_only or commercial_ok(entry.license))
            and selection.is_static in (None, entry.is_static)
            and (wanted is None or entry.identifier in wanted)
        )

    def clip(self, position: int, part: ClipPart = FULL_CLIP) -> Clip:
        """Read one clip, or a part of it.

        Raises:
            InputError: no such position, or the clip lacks the frames or views of ``part``.
            FileFormatError: the shard is missing or damaged; names shard, clip and member.
        """
        if not 0 <= position < len(self):
            raise InputError(f"position: expected 0 to {len(self) - 1}, got {position}")
        reader, entry = self._places[position]
        wanted = wanted_members(reader.slots(entry.identifier), entry, part)
        members = reader.read(entry.identifier, wanted, self._verify)
        try:
            return self._checked(decode_clip(members, entry, part))
        except FileFormatError as error:
            raise FileFormatError(f"{reader.file}: clip '{entry.identifier}', {error}") from error

    def checksum(self, position: int) -> str:
        """Of the stored clip, by the checksums of its members: equal for equal bytes.

        Raises:
            FileFormatError: the index of the shard is missing or damaged.
        """
        reader, entry = self._places[position]
        slots = reader.slots(entry.identifier)
        text = " ".join(f"{name} {slot.size} {slot.crc32}" for name, slot in sorted(slots.items()))
        return hashlib.sha256(text.encode()).hexdigest()

    def encoded(self, position: int) -> EncodedClip:
        """One clip as it is stored, to be copied into other shards.

        Raises:
            FileFormatError: the shard is missing or damaged; names shard, clip and member.
        """
        reader, entry = self._places[position]
        content = reader.read(entry.identifier, reader.slots(entry.identifier))
        source = decode_metadata(content["meta.json"], entry).source
        members = tuple(Member(suffix=suffix, content=each) for suffix, each in content.items())
        return EncodedClip(entry=entry, source=source, members=members)

    def check(self) -> None:
        """Read every byte of every clip and compare checksums; indices must match the manifest.

        Raises:
            FileFormatError: the first damage found.
        """
        for reader, entry in self._places:
            reader.read(entry.identifier, reader.slots(entry.identifier))

    def _checked(self, clip: Clip) -> Clip:
        if self._verify:
            try:
                require_valid_clip(clip)
            except InputError as error:
                raise FileFormatError(f"as stored, {error}; write it again") from error
        return clip
