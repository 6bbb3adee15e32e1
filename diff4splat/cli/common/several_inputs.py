"""Several photos in one command: one that fails does not stop the others."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from diff4splat.errors import ConfigError, Diff4SplatError, InputError

PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".avif", ".tif", ".tiff", ".bmp", ".heic")
MAX_NAMED = 5


def photo_files(given: Iterable[Path]) -> list[Path]:
    """The files, and for each folder the photos directly in it by name.

    Raises:
        ConfigError: nothing is given, or one photo twice.
        InputError: a folder has no photo.
    """
    photos = [photo for path in given for photo in (_in_folder(path) if path.is_dir() else [path])]
    if not photos:
        raise ConfigError("generate: expected a photo or a folder of photos, got none; name one")
    twice = [photo for photo, count in Counter(photos).items() if count > 1]
    if twice:
        raise ConfigError(f"generate: expected each photo once, got {twice[0]} twice")
    return photos


def _in_folder(folder: Path) -> list[Path]:
    found = sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in PHOTO_SUFFIXES and not file.name.startswith(".")
    )
    if not found:
        raise InputError(f"{folder}: expected photos, got none in this folder; check the path")
    return found


def folder_names(photos: Sequence[Path]) -> dict[Path, str]:
    """A folder name for each photo: its own without suffix, numbered where several share one."""
    names: dict[Path, str] = {}
    taken: set[str] = set()
    for photo in photos:
        name, number = photo.stem, 1
        while name.casefold() in taken:
            number += 1
            name = f"{photo.stem}-{number}"
        taken.add(name.casefold())
        names[photo] = name
    return names


def run_each(jobs: Sequence[tuple[Path, Callable[[], None]]]) -> None:
    """Run every job; errors of one are printed and do not stop the others.

    Raises:
        InputError: some failed; names them.
    """
    from diff4splat.cli.common.console import fail, note

    failed = []
    for number, (photo, job) in enumerate(jobs, start=1):
        note(f"photo {number} of {len(jobs)}: {photo}")
        try:
            job()
        except Diff4SplatError as error:
            fail(error)
            failed.append(photo.name)
    if failed:
        more = f" and {len(failed) - MAX_NAMED} more" if len(failed) > MAX_NAMED else ""
        raise InputError(
            f"expected all {len(jobs)} photos to work, got {len(failed)} that failed: "
            f"{', '.join(failed[:MAX_NAMED])}{more}; see the lines above"
        )
