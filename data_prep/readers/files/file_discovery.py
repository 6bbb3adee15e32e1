"""Finds the files of a capture; names in data files never lead outside its folder."""

import os
import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.require_file import is_file
from diff4splat.paths.messages import quoted

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".exr", ".npy")

_CAMERA = re.compile(r"cam(era)?[_-]?[0-9]+", re.IGNORECASE)
_MAX_DIGITS = 18
_PATH_BYTES, _NAME_BYTES = 2048, 240
"""Somewhat less than Linux allows: a suffix may be appended."""
_VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".avi", ".webm")


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureLocation:
    """The folder of a capture, and the file in it if a file was given."""

    folder: Path
    file: Path | None = None
    """The given file, if any."""

    @property
    def name(self) -> str:
        """Name of the capture."""
        return self.folder.resolve().name


def locate_capture(path: Path | str) -> CaptureLocation:
    """The folder at ``path``, or that of the file there.

    Raises:
        InputError: nothing is there, or the folder is empty.
    """
    path = Path(path)
    if path.suffix.lower() in (*_VIDEO_SUFFIXES, ".gif") and not path.is_dir():
        raise InputError(
            f"{path}: expected a folder with images, poses and times, got one video; "
            "estimate its poses with COLMAP and give that folder"
        )
    if path.is_file():
        return CaptureLocation(folder=path.parent, file=path)
    if not path.is_dir():
        raise InputError(f"{path}: expected a capture, got no such folder; check the path")
    if not any(path.iterdir()):
        raise InputError(f"{path}: expected a capture, got an empty folder; check the path")
    return CaptureLocation(folder=path)


def resolve_inside(folder: Path, name: str, where: str) -> Path:
    """The path ``name`` inside ``folder``.

    Raises:
        FileFormatError: it is empty, absolute, leaves the folder, or is no name of a file.
    """
    plain = os.path.normpath(name.replace("\\", "/")) if _is_name(name) else ".."
    if os.path.isabs(plain) or plain == ".." or plain.startswith("../"):
        raise FileFormatError(
            f"{where}: expected a path inside {folder}, got {quoted(name)}; move the file there "
            "and write its path from there"
        )
    return folder / plain


def _is_name(name: str) -> bool:
    """Whether a file can have this name: systems limit the length of a path and of its parts."""
    encoded = name.encode(errors="replace")
    parts = encoded.replace(b"\\", b"/").split(b"/")
    encodable = encoded.decode() == name and b"\0" not in encoded
    longest = max(len(part) for part in parts)
    return bool(name) and encodable and len(encoded) <= _PATH_BYTES and longest <= _NAME_BYTES


def find_image(folder: Path, name: str, where: str) -> Path:
    """The image ``name``; its suffix may be omitted, as in D-NeRF.

    Raises:
        FileFormatError: there is none, or the name leaves the folder.
    """
    file = resolve_inside(folder, name, where)
    for candidate in (file, *(file.with_name(file.name + suffix) for suffix in IMAGE_SUFFIXES)):
        if is_file(candidate):
            return candidate
    raise FileFormatError(f"{where}: expected the image {file}, got no such file; copy it again")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sorts ``frame_10`` after ``frame_9``."""
    parts = re.split(r"([0-9]+)", name)
    return tuple((1, _number(part), part) if part.isdecimal() else (0, 0, part) for part in parts)


def images_in(folder: Path) -> list[Path]:
    """Every image directly in ``folder``, in natural order; without hidden files."""
    files = [
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGE_SUFFIXES and not file.name.startswith(".")
    ]
    return sorted(files, key=lambda file: natural_key(file.name))


def images_below(folder: Path) -> list[Path]:
    """Every image in ``folder`` and its subfolders, in natural order of their paths."""
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    files = [file for one in folders for file in images_in(one)]
    return sorted(files, key=lambda file: natural_key(file.relative_to(folder).as_posix()))


def camera_folders(folder: Path) -> dict[str, Path]:
    """``cam00``, ``cam01`` and so on, by name, with the folder of their images."""
    found = {}
    for path in folder.iterdir():
        if path.is_dir() and _CAMERA.fullmatch(path.name):
            images = path / "images" if (path / "images").is_dir() else path
            if images_in(images):
                found[path.name] = images
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
    numbers = re.findall(r"[0-9]+", PurePosixPath(name).stem)
    return _number(numbers[-1]) if numbers else None


def _number(digits: str) -> int:
    """Of a name; one of hundreds of digits counts by its last ones, which Python can convert."""
    return int(digits[-_MAX_DIGITS:])
