"""Finds sequences and files of data sets by the names that the formats fix."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from diff4splat.data_prep.readers.files.file_discovery import natural_key
from diff4splat.errors import FileFormatError

_DEEPEST = 8
"""Folders below the given one; links that turn back end here."""


def folders_below(root: Path, wanted: Callable[[Path], bool]) -> Iterator[Path]:
    """Every folder that is wanted, the given one included, in natural order; not inside those."""
    yield from _walk(root, wanted, _DEEPEST)


def _walk(folder: Path, wanted: Callable[[Path], bool], depth: int) -> Iterator[Path]:
    if wanted(folder):
        yield folder
        return
    if depth:
        inner = [path for path in folder.iterdir() if path.is_dir() and path.name[0] != "."]
        for path in sorted(inner, key=lambda path: natural_key(path.name)):
            yield from _walk(path, wanted, depth - 1)


def name_below(root: Path, folder: Path) -> str:
    """The path from the root, or the folder's own name if it is the root."""
    return folder.relative_to(root).as_posix() if folder != root else folder.resolve().name


def numbered_files(folder: Path, pattern: str) -> dict[int, Path]:
    """Files of ``folder`` by the number that the group of ``pattern`` matches, in order.

    Raises:
        FileFormatError: there is no such folder, or no such file in it.
    """
    if not folder.is_dir():
        raise FileFormatError(f"{folder}: expected a folder, got none; unpack that part too")
    found = {}
    for file in folder.iterdir():
        match = re.fullmatch(pattern, file.name)
        if match:
            found[int(match[1])] = file
    if not found:
        raise FileFormatError(
            f"{folder}: expected files like {pattern.replace(chr(92), '')}, got none; unpack them"
        )
    return dict(sorted(found.items()))


def require_consecutive(files: dict[int, Path], first: int) -> list[Path]:
    """The files, numbered without a gap from ``first``.

    Raises:
        FileFormatError: one is missing.
    """
    lacking = next((n for n, got in enumerate(files, first) if n != got), None)
    if lacking is not None:
        example = next(iter(files.values()))
        raise FileFormatError(
            f"{example.parent}: expected images numbered from {first} without a gap, got none of "
            f"number {lacking}; copy it again"
        )
    return list(files.values())


def require_equal_counts(where: Path, counts: dict[str, int]) -> None:
    """Require as many of one thing as of the other.

    Raises:
        FileFormatError: the counts differ; names them.
    """
    if len(set(counts.values())) > 1:
        got = ", ".join(f"{count} {what}" for what, count in counts.items())
        raise FileFormatError(
            f"{where}: expected as many {' as '.join(counts)}, got {got}; copy the folder again"
        )
