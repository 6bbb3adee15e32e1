"""Detects the format of a capture and reads it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.capture.capture import Capture
from diff4splat.data.capture.checks import require_valid_capture
from diff4splat.data_prep.readers.camera_rig import neu3d
from diff4splat.data_prep.readers.colmap import reader as colmap
from diff4splat.data_prep.readers.common.assembly import assemble_capture
from diff4splat.data_prep.readers.common.undecoded_capture import UndecodedCapture
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation, locate_capture
from diff4splat.data_prep.readers.native import camera_json, clips
from diff4splat.data_prep.readers.nerfies import reader as nerfies
from diff4splat.data_prep.readers.options import FormatName, ReadOptions
from diff4splat.data_prep.readers.transforms import dnerf, nerfstudio
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reader:
    expected_files: str
    matches: Callable[[Path], bool]
    read: Callable[[CaptureLocation, ReadOptions], UndecodedCapture | Capture]


_READERS: dict[FormatName, _Reader] = {
    name: _Reader(expected_files=module.EXPECTED_FILES, matches=module.matches, read=module.read)
    for name, module in {
        "dnerf": dnerf,
        "neu3d": neu3d,
        "hypernerf": nerfies,
        "colmap": colmap,
        "transforms": nerfstudio,
        "clips": clips,
        "cameras": camera_json,
    }.items()
}


def read_capture(path: Path | str, options: ReadOptions | None = None) -> Capture:
    """Read the capture in a folder, or in the folder of a file; images are decoded on demand.

    Raises:
        InputError: no such folder, none or several formats, or a scene cannot be fitted to it.
        ConfigError: an option does not fit the capture.
        FileFormatError: a file is missing, damaged or of another form; names it.
    """
    options, location = options or ReadOptions(), locate_capture(path)
    name = _detected(location) if options.format == "auto" else options.format
    found = _READERS[name].read(location, options)
    return require_valid_capture(
        assemble_capture(found, options) if isinstance(found, UndecodedCapture) else found
    )


def detect_format(path: Path | str) -> FormatName:
    """Detect the format of a folder, or of the folder of a file.

    Raises:
        InputError: none or several; lists the expected files of each.
    """
    return _detected(locate_capture(path))


def _detected(location: CaptureLocation) -> FormatName:
    if location.file is not None and _is_other_json(location.file):
        return "transforms"
    found = [name for name, reader in _READERS.items() if reader.matches(location.folder)]
    if len(found) == 1:
        return found[0]
    if found:
        both = "; ".join(f"{name}: {_READERS[name].expected_files}" for name in found)
        raise InputError(
            f"{location.folder}: expected one format, got files of {len(found)} ({both}); name the "
            "format"
        )
    known = "; ".join(f"{name}: {reader.expected_files}" for name, reader in _READERS.items())
    raise InputError(f"{location.folder}: expected a capture, got none of these ({known})")


def _is_other_json(file: Path) -> bool:
    """Whether a JSON file is a ``transforms.json`` under another name."""
    others = ("dataset.json", "metadata.json", "scene.json", "manifest.json")
    split = file.name.startswith("transforms_") and dnerf.matches(file.parent)
    ours = file.name == "camera.json" and camera_json.matches(file.parent)
    return file.suffix.lower() == ".json" and file.name not in others and not (split or ours)
