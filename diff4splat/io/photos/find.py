"""Photographs of a folder."""

from pathlib import Path

from diff4splat.errors import InputError

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp")


def find_photographs(folder: Path, option: str) -> list[Path]:
    """Photographs in ``folder``, by name; ``option`` is what named the folder.

    Raises:
        InputError: there are none.
    """
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() in SUFFIXES)
    if not files:
        raise InputError(
            f"{folder}: expected photographs ({', '.join(SUFFIXES)}), got none; correct {option}"
        )
    return files
