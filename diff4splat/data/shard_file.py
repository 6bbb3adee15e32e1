"""One growing shard: a plain tar in webdataset layout under a temporary name.

Layout: per member a USTAR header of 512 bytes (fixed time, owner and mode), the content, zeros up
to the next 512; two blocks of zeros end the archive, filled up to 10240 as tar does. Source: POSIX
1003.1-1988, as Python's ``tarfile`` writes it.
"""

import filecmp
import os
import tarfile
import zlib
from contextlib import suppress
from pathlib import Path

from diff4splat.data.codecs.encode import EncodedClip
from diff4splat.data.shard_index import ShardIndex, Slot


class ShardFile:
    """Collects clips in ``temporary``: ``close``, then ``rename``; or ``discard``."""

    def __init__(self, temporary: Path) -> None:
        self._temporary = temporary
        self._stream = temporary.open("xb")
        self._clips: dict[str, dict[str, Slot]] = {}

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._stream.tell()

    def write(self, clip: EncodedClip) -> None:
        """Append the members of one clip."""
        slots: dict[str, Slot] = {}
        for member in clip.members:
            content = member.content
            self._stream.write(_header(f"{clip.entry.identifier}.{member.suffix}", len(content)))
            slots[member.suffix] = Slot(self.size, len(content), zlib.crc32(content))
            self._stream.write(content)
            self._stream.write(bytes(-len(content) % tarfile.BLOCKSIZE))
        self._clips[clip.entry.identifier] = slots

    def close(self) -> tuple[ShardIndex, int]:
        """End the archive; its index and its size in bytes."""
        self._stream.write(bytes(2 * tarfile.BLOCKSIZE))
        self._stream.write(bytes(-self.size % tarfile.RECORDSIZE))
        size = self.size
        self._stream.close()
        return ShardIndex(clips=self._clips), size

    def equals(self, other: Path) -> bool:
        """Whether a file has the bytes of the closed archive."""
        return other.is_file() and filecmp.cmp(self._temporary, other, shallow=False)

    def rename(self, target: Path) -> None:
        """Give the closed archive its name."""
        os.replace(self._temporary, target)

    def discard(self) -> None:
        """Leave nothing behind."""
        # A full disk fails again when the last bytes are flushed; why it failed is already known.
        with suppress(OSError):
            self._stream.close()
        with suppress(OSError):
            self._temporary.unlink()


def _header(name: str, size: int) -> bytes:
    """Modification time, owner and group stay 0 and nameless, so that equal clips are equal."""
    info = tarfile.TarInfo(name)
    info.size = size
    return info.tobuf(tarfile.USTAR_FORMAT)
