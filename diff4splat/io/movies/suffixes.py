"""Which names are moving images; imports no library."""

from pathlib import Path

VIDEO_SUFFIXES = (".mp4", ".webm", ".gif", ".webp")


def is_sequence(file: Path) -> bool:
    """Whether a name counts: ``frames/%04d.png``."""
    return file.suffix.lower() == ".png" and "%" in file.name


def is_movie(file: Path) -> bool:
    """Whether a moving image is written under this name."""
    return file.suffix.lower() in VIDEO_SUFFIXES or is_sequence(file)
