"""Which reader a folder is for, and the one way to read a capture."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.capture.capture import Capture
from diff4splat.data.capture.checks import require_usable_capture
from diff4splat.data_prep.readers import (
    clips,
    colmap,
    dnerf,
    hypernerf,
    neu3d,
    physical,
    transforms,
)
from diff4splat.data_prep.readers.assembly import finish
from diff4splat.data_prep.readers.options import FormatName, ReadOptions
from diff4splat.data_prep.readers.places import Place, place_of
from diff4splat.data_prep.readers.shots import Draft
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reader:
    looks_like: str
    matches: Callable[[Path], bool]
    read: Callable[[Place, ReadOptions], Draft | Capture]


_READERS: dict[FormatName, _Reader] = {
    name: _Reader(looks_like=module.LOOKS_LIKE, matches=module.matches, read=module.read)
    for name, module in {
        "dnerf": dnerf,
        "neu3d": neu3d,
        "hypernerf": hypernerf,
        "colmap": colmap,
        "transforms": transforms,
        "clips": clips,
        "cameras": physical,
    }.items()
}


def read_capture(path: Path | str, options: ReadOptions | None = None) -> Capture:
    """The capture in a folder, or in the folder of a file; pictures are read when asked for.

    Raises:
        InputError: no such folder, none or several formats, or a scene cannot be fitted to it.
        ConfigError: an option does not fit the capture.
        FileFormatError: a file is missing, damaged or of another form; names it.
    """
    options, place = options or ReadOptions(), place_of(path)
    name = _detected(place) if options.format == "auto" else options.format
    found = _READERS[name].read(place, options)
    return require_usable_capture(finish(found, options) if isinstance(found, Draft) else found)


def detect_format(path: Path | str) -> FormatName:
    """Which format a folder, or the folder of a file, is in.

    Raises:
        InputError: none or several; lists what each looks like.
    """
    return _detected(place_of(path))


def _detected(place: Place) -> FormatName:
    if place.file is not None and _is_other_json(place.file):
        return "transforms"
    found = [name for name, reader in _READERS.items() if reader.matches(place.folder)]
    if len(found) == 1:
        return found[0]
    if found:
        both = "; ".join(f"{name}: {_READERS[name].looks_like}" for name in found)
        raise InputError(
            f"{place.folder}: expected one format, got files of {len(found)} ({both}); name the "
            "format"
        )
    known = "; ".join(f"{name}: {reader.looks_like}" for name, reader in _READERS.items())
    raise InputError(f"{place.folder}: expected a capture, got none of these ({known})")


def _is_other_json(file: Path) -> bool:
    """A ``transforms.json`` by whatever name; files that other formats name decide nothing."""
    others = ("dataset.json", "metadata.json", "scene.json", "manifest.json")
    split = file.name.startswith("transforms_") and dnerf.matches(file.parent)
    ours = file.name == "camera.json" and physical.matches(file.parent)
    return file.suffix.lower() == ".json" and file.name not in others and not (split or ours)
