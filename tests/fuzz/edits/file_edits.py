"""Damage to a file as a whole: gone, empty, a folder, a pipe, a device, a link to nothing."""

import os
from collections.abc import Callable
from pathlib import Path
from random import Random


def _empty(file: Path) -> None:
    file.write_bytes(b"")


def _folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def _pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def _device(file: Path) -> None:
    file.unlink()
    file.symlink_to("/dev/zero")


def _loop(file: Path) -> None:
    file.unlink()
    file.symlink_to(file)


FILE_EDITS: dict[str, Callable[[Path], None]] = {
    "delete": Path.unlink,
    "empty": _empty,
    "folder": _folder,
    "pipe": _pipe,
    "device": _device,
    "loop": _loop,
}


def edit_file(file: Path, rng: Random) -> None:
    """One of these, in place of the file."""
    rng.choice(list(FILE_EDITS.values()))(file)
