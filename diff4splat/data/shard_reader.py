"""One shard for reading: its index, and members by seeking. Nothing stays open between reads."""

import os
import zlib
from collections.abc import Collection
from pathlib import Path

from diff4splat.data.manifest import ShardEntry
from diff4splat.data.shard_index import ShardIndex, Slot, read_index
from diff4splat.errors import FileFormatError

_SPARE_BYTES, _PER_PIXEL, _PER_POINT = 16 << 20, 16, 32
"""Bytes of a member: flow takes 8 per pixel, tracks 12 per point, before they are packed."""


class ShardReader:
    """Members of the clips of one shard; the index is read when it is first needed."""

    def __init__(self, folder: Path, entry: ShardEntry) -> None:
        """Look whether the shard is there and whole.

        Raises:
            FileFormatError: it is missing or of another size than the manifest says.
        """
        self.file = folder / entry.name
        self._entry = entry
        self._index: ShardIndex | None = None
        try:
            size = os.stat(self.file).st_size
        except OSError as error:
            raise FileFormatError(
                f"{self.file}: expected a shard of {entry.size} bytes, got '{error.strerror}'; "
                "copy it again"
            ) from error
        if size != entry.size:
            raise FileFormatError(
                f"{self.file}: expected a shard of {entry.size} bytes, got {size}; copy it again"
            )

    def slots(self, identifier: str) -> dict[str, Slot]:
        """Where the members of a clip lie, by suffix.

        Raises:
            FileFormatError: the index is missing, damaged, or has other clips than the manifest.
        """
        if self._index is None:
            self._index = self._read_index()
        return self._index.clips[identifier]

    def read(
        self, identifier: str, suffixes: Collection[str], verify: bool = True
    ) -> dict[str, bytes]:
        """The contents of some members of a clip; ``verify`` compares their checksums.

        Raises:
            FileFormatError: the shard cannot be read, is cut off or damaged.
        """
        slots, most = self.slots(identifier), self._most_bytes(identifier)
        for suffix in suffixes:
            if slots[suffix].size > most:
                raise FileFormatError(
                    f"{self.file}: clip '{identifier}', '{suffix}': expected up to {most} bytes "
                    f"for its frames, got {slots[suffix].size}; the index is damaged, copy it again"
                )
        try:
            with self.file.open("rb") as stream:
                contents = {}
                for suffix in sorted(suffixes, key=lambda name: slots[name].offset):
                    stream.seek(slots[suffix].offset)
                    contents[suffix] = stream.read(slots[suffix].size)
        except OSError as error:
            raise FileFormatError(
                f"{self.file}: expected to read clip '{identifier}', got '{error.strerror}'"
            ) from error
        for suffix, content in contents.items():
            # Checksums of everything before anything is decoded: decoders are not for damage.
            if len(content) != slots[suffix].size or (
                verify and zlib.crc32(content) != slots[suffix].crc32
            ):
                raise FileFormatError(
                    f"{self.file}: clip '{identifier}', '{suffix}': expected {slots[suffix].size} "
                    f"bytes with checksum {slots[suffix].crc32:08x}, got {len(content)} with "
                    f"{zlib.crc32(content):08x}; the shard is damaged, copy it again"
                )
        return contents

    def _most_bytes(self, identifier: str) -> int:
        """More than any member of a clip can take: an index could claim the whole disk."""
        clip = next(clip for clip in self._entry.clips if clip.identifier == identifier)
        pixels = clip.frames * clip.size_px[0] * clip.size_px[1]
        tracked = clip.frames * clip.tracks * (clip.views + 1)
        return _SPARE_BYTES + _PER_PIXEL * pixels + _PER_POINT * tracked

    def _read_index(self) -> ShardIndex:
        index = read_index(self.file, self._entry.size)
        odd = {clip.identifier for clip in self._entry.clips} ^ set(index.clips)
        if odd:
            raise FileFormatError(
                f"{self.file}: expected the same clips in manifest and index, got '{min(odd)}' in "
                "one of them alone; copy shard, index and manifest again"
            )
        return index
