"""Images inside a tar, read where they lie: nothing is unpacked, and no name leads outside."""

import tarfile
from pathlib import Path, PurePosixPath

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import require_file

_LARGEST = 1 << 28
"""Bytes of one image."""


class TarImages:
    """The members of one tar by file name."""

    def __init__(self, file: Path) -> None:
        """Read the headers.

        Raises:
            FileFormatError: missing, cut off or damaged, or a member's name leads outside.
        """
        require_file(file, "a tar")
        self.file = file
        self._places: dict[str, tuple[int, int]] = {}
        try:
            with tarfile.open(file, "r:") as archive:
                for member in archive:
                    self._add(member)
        except FileFormatError:
            raise
        except (tarfile.TarError, OSError, ValueError) as error:
            raise FileFormatError(
                f"{file}: expected a whole tar, got a cut off or damaged one; copy it again"
            ) from error

    def __contains__(self, name: str) -> bool:
        return name in self._places

    @property
    def names(self) -> tuple[str, ...]:
        """File names, without folders."""
        return tuple(self._places)

    def read(self, name: str) -> bytes:
        """The content of one member.

        Raises:
            FileFormatError: there is none of this name, or the tar is cut off.
        """
        if name not in self._places:
            raise FileFormatError(f"{self.file}: expected '{name}' in it, got a tar without it")
        offset, size = self._places[name]
        with self.file.open("rb") as stream:
            stream.seek(offset)
            content = stream.read(min(size, _LARGEST))
        if len(content) != size:
            raise FileFormatError(f"{self.file}: expected all of '{name}', got a cut off tar")
        return content

    def _add(self, member: tarfile.TarInfo) -> None:
        path = PurePosixPath(member.name)
        if path.is_absolute() or ".." in path.parts:
            raise FileFormatError(
                f"{self.file}: expected members inside the tar, got {member.name[:80]!r}, which "
                "leads outside; do not unpack it, get it from its source again"
            )
        if member.isreg():
            self._places[path.name] = (member.offset_data, member.size)
