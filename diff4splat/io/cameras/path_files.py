"""Camera path files: which format it is, reading, writing.

Axes: ``t`` poses. A path that was read starts at the identity and at time 0, whatever world and
clock the file used, and has the dtype of the default camera. The image size is that of the file
where it says one; ``paths.image_size.resized`` brings it to another.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import torch

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import relative_to_first
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import is_file, read_bytes
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.paths.formats import camera_path_json, realestate10k, transforms_json, tum
from diff4splat.paths.formats.json_fields import load_object
from diff4splat.paths.formats.source import DEFAULT_FPS, PathSource
from diff4splat.paths.formats.text_table import data_lines, is_heading
from diff4splat.paths.messages import unknown_name

MAX_BYTES = 64 * 2**20

PathFormat = Literal["realestate10k", "transforms_json", "camera_path_json", "tum"]

_PARSERS: dict[PathFormat, Callable[[str, PathSource], CameraPath]] = {
    "realestate10k": realestate10k.parse,
    "transforms_json": transforms_json.parse,
    "camera_path_json": camera_path_json.parse,
    "tum": tum.parse,
}
_DUMPERS: dict[PathFormat, Callable[[CameraPath], str]] = {
    "realestate10k": realestate10k.dump,
    "transforms_json": transforms_json.dump,
    "camera_path_json": camera_path_json.dump,
    "tum": tum.dump,
}


def read_path(file: Path, view: Camera, fps: float = DEFAULT_FPS) -> CameraPath:
    """The camera path in ``file``, relative to its first camera; the format is found by content.

    ``view`` (one camera) stands in for intrinsics and image size that the file lacks, ``fps``
    for times.

    Raises:
        InputError: no such file, or it cannot be opened.
        FileFormatError: naming the line or frame that is wrong.
    """
    source = PathSource(name=str(file), view=view, fps=fps)
    text = _read_text(file)
    path = _PARSERS[detect_format(text, source.name)](text, source)
    # Both differences come before the cast: map coordinates and clock times do not fit float32.
    started = CameraPath(
        cameras=relative_to_first(path.cameras).to(view.focal_px.dtype),
        times_s=(path.times_s - path.times_s[0]).to(view.focal_px.dtype),
    )
    return require_valid_path(_with_exact_start(started), source.name)


def write_path(path: CameraPath, file: Path, format: PathFormat | None = None) -> None:
    """Write ``path`` whole or not at all; without ``format`` the name decides (see ``format_for``).

    Raises:
        InputError: the path is not usable, or the format is unknown or cannot hold it.
        OutputError: the file cannot be written.
    """
    require_valid_path(path, "camera path")
    write_text(file, _DUMPERS[format_for(file) if format is None else _known(format)](path))


def format_for(file: Path) -> PathFormat:
    """``.tum``, ``.txt`` (RealEstate10K), ``*camera_path*.json``, any other ``.json`` (transforms).

    Raises:
        InputError: another suffix.
    """
    suffix = file.suffix.lower()
    if suffix == ".json":
        return "camera_path_json" if "camera_path" in file.name.lower() else "transforms_json"
    if suffix == ".txt":
        return "realestate10k"
    if suffix == ".tum":
        return "tum"
    raise InputError(
        f"{file}: expected a name ending in .json, .txt or .tum; rename it or name the format "
        f"({', '.join(get_args(PathFormat))})"
    )


def detect_format(text: str, name: str) -> PathFormat:
    """Which of the formats ``text`` is in.

    Raises:
        FileFormatError: none of them; says what was found.
    """
    if not text.strip():
        raise FileFormatError(
            f"{name}: expected camera poses, got an empty file; choose another file"
        )
    if text.lstrip()[0] in "{[":
        return _json_format(text, name)
    lines = [entry for _, entry in zip(range(2), data_lines(text), strict=False)]
    if lines and is_heading(lines[0][1]):
        lines = lines[1:]
    if not lines:
        raise FileFormatError(
            f"{name}: expected camera poses, got no line of numbers; choose another file"
        )
    number, words = lines[0]
    by_columns: dict[int, PathFormat] = {realestate10k.COLUMNS: "realestate10k", tum.COLUMNS: "tum"}
    if len(words) not in by_columns:
        raise FileFormatError(
            f"{name}: line {number}: expected {realestate10k.COLUMNS} columns (RealEstate10K) or "
            f"{tum.COLUMNS} (TUM), got {len(words)}; check that this is a camera path"
        )
    return by_columns[len(words)]


def _json_format(text: str, name: str) -> PathFormat:
    root = load_object(text, name)
    if "camera_path" in root:
        return "camera_path_json"
    if "frames" in root:
        return "transforms_json"
    raise FileFormatError(
        f"{name}: expected 'frames' (transforms.json) or 'camera_path' (camera_path.json), got "
        "neither; check that this is a camera path"
    )


def _known(format: str) -> PathFormat:
    for known in get_args(PathFormat):
        if format == known:
            return known
    raise InputError(unknown_name("path format", format, get_args(PathFormat)))


def _read_text(file: Path) -> str:
    error = FileFormatError if is_file(file) else InputError
    content = read_bytes(file, "camera poses", error, MAX_BYTES)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise FileFormatError(
            f"{file}: expected a text file in UTF-8, got binary data; choose another file"
        )
    return text


def _with_exact_start(path: CameraPath) -> CameraPath:
    """The first pose is the identity but for rounding; make it exact."""
    poses = path.cameras.world_from_camera.clone()
    poses[0] = torch.eye(4, dtype=poses.dtype)
    return replace(path, cameras=replace(path.cameras, world_from_camera=poses))
