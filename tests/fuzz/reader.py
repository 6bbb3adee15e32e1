"""What the harness knows of a reader."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """Files in a folder, and what reads them."""

    make: Callable[[Path], object]
    """Writes a valid example into an empty folder."""
    read: Callable[[Path], object]
    """Reads it, and uses what was read as far as a first use would."""


def read_each(folder: Path, read: Callable[[Path], object]) -> None:
    """Every file by itself; the first error is raised after all were read.

    A file that was read before, and still has the same content, is not read again.
    """
    errors = []
    for file in sorted(folder.iterdir()):
        plain = file.is_file() and not file.is_symlink()
        content = file.read_bytes() if plain else None
        if plain and _READ.get(file) == content:
            continue
        try:
            read(file)
        except Exception as error:
            errors.append(error)
        else:
            _READ.setdefault(file, content)
    if errors:
        raise errors[0]


_READ: dict[Path, bytes | None] = {}
"""The first content of each file that was read without error."""
