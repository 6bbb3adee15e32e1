"""Where the files of a capture lie: names out of data are never followed out of its folder."""

import os
import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from diff4splat.errors import FileFormatError, InputError
from diff4splat.paths.messages import quoted

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".exr", ".npy")

_CAMERA = re.compile(r"cam(era)?[_-]?\d+", re.IGNORECASE)
_VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".avi", ".webm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """What a person pointed at."""

    folder: Path
    file: Path | None = None
    """When it was a file of the folder."""

    @property
    def name(self) -> str:
        """What the capture is called."""
        return self.folder.resolve().name


def place_of(path: Path | str) -> Place:
    """The folder at ``path``, or that of the file there.

    Raises:
        InputError: nothing is there, or the folder is empty.
    """
    path = Path(path)
    if path.is_file():
        return Place(folder=path.parent, file=path)
    if not path.is_dir():
        raise InputError(f"{path}: expected a capture, got no such folder; check the path")
    if not any(path.iterdir()):
        raise InputError(f"{path}: expected a capture, got an empty folder; check the path")
    return Place(folder=path)


def inside(folder: Path, name: str, where: str) -> Path:
    """The path called ``name`` in ``folder``.

    Raises:
        FileFormatError: it is empty, absolute, or leaves the folder.
    """
    plain = os.path.normpath(name.replace("\\", "/")) if name and "\0" not in name else ".."
    if os.path.isabs(plain) or plain == ".." or plain.startswith("../"):
        raise FileFormatError(
            f"{where}: expected a path inside {folder}, got {quoted(name)}; move the file there "
            "and write its path from there"
        )
    return folder / plain


def picture_at(folder: Path, name: str, where: str) -> Path:
    """The picture called ``name``, whose suffix may be left away as in D-NeRF.

    Raises:
        FileFormatError: there is none, or the name leaves the folder.
    """
    file = inside(folder, name, where)
    for candidate in (file, *(file.with_name(file.name + suffix) for suffix in PICTURE_SUFFIXES)):
        if candidate.is_file():
            return candidate
    raise FileFormatError(f"{where}: expected the picture {file}, got no such file; copy it again")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sorts ``frame_10`` after ``frame_9``."""
    parts = re.split(r"(\d+)", name)
    return tuple((1, int(part), part) if part.isdigit() else (0, 0, part) for part in parts)


def pictures_in(folder: Path) -> list[Path]:
    """Every picture directly in ``folder``, in natural order; hidden files do not count."""
    files = [
        file
        for file in folder.iterdir()
        if file.suffix.lower() in PICTURE_SUFFIXES and not file.name.startswith(".")
    ]
    return sorted(files, key=lambda file: natural_key(file.name))


def pictures_below(folder: Path) -> list[Path]:
    """Every picture in ``folder`` and the folders in it, in natural order of their paths."""
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    files = [file for one in folders for file in pictures_in(one)]
    return sorted(files, key=lambda file: natural_key(file.relative_to(folder).as_posix()))


def camera_folders(folder: Path) -> dict[str, Path]:
    """``cam00``, ``cam01`` and so on, by name, with the folder their pictures lie in."""
    found = {}
    for path in folder.iterdir():
        if path.is_dir() and _CAMERA.fullmatch(path.name):
            pictures = path / "images" if (path / "images").is_dir() else path
            if pictures_in(pictures):
                found[path.name] = pictures
    return dict(sorted(found.items(), key=lambda item: natural_key(item[0])))


def camera_videos(folder: Path) -> dict[str, Path]:
    """``cam00.mp4``, ``cam01.mp4`` and so on, by name without suffix."""
    found = {
        path.stem: path
        for path in folder.iterdir()
        if path.suffix.lower() in _VIDEO_SUFFIXES and _CAMERA.fullmatch(path.stem)
    }
    return dict(sorted(found.items(), key=lambda item: natural_key(item[0])))


def last_number(name: str) -> int | None:
    """The last number in a file name without its suffix: 12 of ``frame_00012.jpg``."""
    numbers = re.findall(r"\d+", PurePosixPath(name).stem)
    return int(numbers[-1]) if numbers else None
