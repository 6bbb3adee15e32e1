"""``camera.json``: exact cameras, optics and settings of a rendered image sequence.

Axes: ``t`` frames. The record is enough to render the same images from the same scene. Every number
is double precision. Poses are ``world_from_camera`` in OpenCV axes; focal lengths are pixels
per unit of the image plane of the lens, which its ``formula`` defines.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import torch

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import Camera
from diff4splat.io.atomic import write_text
from diff4splat.io.cameras.optics_json import optics_json, read_optics, read_track, track_json
from diff4splat.io.cameras.photo_settings_json import photo_settings_json, read_photo_settings
from diff4splat.io.require_file import read_text
from diff4splat.io.strict_json import (
    JsonObject,
    as_object,
    optional_text,
    take_int,
    take_list,
    take_number,
    take_numbers,
    take_object,
    take_pose,
    take_text,
)
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.paths.formats.json_fields import load_object, optional_number
from diff4splat.paths.physical_path import PhysicalPath
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.scene.scene import Provenance

FILE, FORMAT, VERSION = "camera.json", "diff4splat-camera", 1
GEOMETRY_KINDS = ("depth", "distance")
GeometryKind = Literal["depth", "distance"]
MAX_SIDE_PX = 16384
CONVENTIONS = {
    "axes": "x right, y down, z forward (OpenCV), right-handed",
    "pixels": "centres at +0.5; size_px is (height, width)",
    "units": "lengths in scene units, times in seconds, angles in radians, focal_px in pixels per "
    "unit of the lens's image plane",
    "poses": "world_from_camera maps homogeneous column vectors; a frame's pose is that of time_s",
    "time": "line r of H is read at t + (r/(H-1) - 1/2) readout_s and sees that plus (e - 1/2) "
    "exposure_s, e from 0 to 1; with timestamp 'start' both 1/2 are 0",
    "aperture": "thin lens: a point at depth z is a disc of radius focal radius |1/focus - 1/z| px",
    "depth": "z for 'depth', length of the ray for 'distance'; that of the ray through the middle "
    "of pixel, lens and exposure; 0 where nothing is seen",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameFiles:
    """The files of one frame, named from the folder of ``camera.json``."""

    image: str
    geometry: str | None = None
    """File with depth or distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRecord:
    """Record of one sequence.

    Raises:
        InputError: the numbers of files and frames differ.
    """

    effect: str
    physical_path: PhysicalPath
    frames: tuple[FrameFiles, ...]
    geometry: GeometryKind
    settings: PhotoSettings
    scene: Provenance
    generator: str
    valid: str | None = None
    """Mask image, black outside the field of view of the lens."""
    scene_time_s: float | None = None
    """Fixed scene time of all frames; None if time advances."""
    intervals: int = 1
    """Largest number of time intervals per image."""
    interval_error_px: float = 0.0

    def __post_init__(self) -> None:
        if len(self.frames) != len(self.physical_path):
            raise InputError(
                f"camera record: expected files of {len(self.physical_path)} frames, got those of "
                f"{len(self.frames)}"
            )


def write_camera_record(record: CameraRecord, file: Path) -> None:
    """Write ``record`` atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    write_text(file, json.dumps(_document(record), indent=1, allow_nan=False) + "\n")


def read_camera_record(file: Path) -> CameraRecord:
    """Read a record; memory limits, cutoffs and colours of the settings are the defaults.

    Raises:
        FileFormatError: missing, damaged, of another format or version, or with a value that is
            missing, of another type, or out of range.
    """
    root = load_object(read_text(file, f"a {FORMAT} file"), str(file))
    where = str(file)
    _require_version(root, where)
    try:
        return _record(root, where)
    except InputError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _document(record: CameraRecord) -> dict[str, object]:
    cameras, times_s = record.physical_path.path.cameras, record.physical_path.path.times_s
    track = record.physical_path.track
    return {
        "format": FORMAT,
        "version": VERSION,
        "generator": record.generator,
        "effect": record.effect,
        "license": record.scene.license,
        "scene": asdict(record.scene),
        "scene_time_s": record.scene_time_s,
        "conventions": CONVENTIONS,
        "size_px": list(cameras.size_px),
        "optics": optics_json(record.physical_path.optics),
        "sampling": photo_settings_json(record.settings)
        | {"intervals": record.intervals, "interval_error_px": record.interval_error_px},
        "geometry": record.geometry,
        "valid": record.valid,
        "frames": [
            {
                "file": frame.image,
                record.geometry: frame.geometry,
                "time_s": float(time_s),
                "focal_px": camera.focal_px.tolist(),
                "center_px": camera.center_px.tolist(),
                "world_from_camera": camera.world_from_camera.tolist(),
            }
            for frame, time_s, camera in zip(record.frames, times_s, cameras, strict=True)
        ],
        "track": None if track is None else track_json(track),
    }


def _record(root: JsonObject, where: str) -> CameraRecord:
    frames = [
        as_object(frame, f"{where}: frame {index}")
        for index, frame in enumerate(take_list(root, "frames", where))
    ]
    geometry = take_text(root, "geometry", where, GEOMETRY_KINDS)
    sampling, track = take_object(root, "sampling", where), root.get("track")
    return CameraRecord(
        effect=take_text(root, "effect", where),
        physical_path=PhysicalPath(
            path=_path(frames, _size_px(root, where), where),
            optics=read_optics(root.get("optics"), f"{where}: 'optics'"),
            track=None if track is None else read_track(track, f"{where}: 'track'"),
        ),
        frames=tuple(
            FrameFiles(
                image=take_text(frame, "file", f"{where}: frame {index}"),
                geometry=optional_text(frame, geometry, f"{where}: frame {index}"),
            )
            for index, frame in enumerate(frames)
        ),
        geometry=geometry,
        settings=read_photo_settings(sampling, f"{where}: 'sampling'"),
        scene=_provenance(take_object(root, "scene", where), f"{where}: 'scene'"),
        generator=take_text(root, "generator", where),
        valid=optional_text(root, "valid", where),
        scene_time_s=optional_number(root, "scene_time_s", where),
        intervals=take_int(sampling, "intervals", where, least=1),
        interval_error_px=take_number(sampling, "interval_error_px", where),
    )


def _path(frames: list[dict[str, object]], size_px: tuple[int, int], where: str) -> CameraPath:
    names = [f"{where}: frame {index}" for index in range(len(frames))]
    named = list(zip(frames, names, strict=True))
    path = CameraPath(
        cameras=Camera(
            focal_px=torch.stack(
                [take_numbers(frame, "focal_px", 2, name) for frame, name in named]
            ),
            center_px=torch.stack(
                [take_numbers(frame, "center_px", 2, name) for frame, name in named]
            ),
            world_from_camera=torch.stack(
                [take_pose(frame, "world_from_camera", name) for frame, name in named]
            ),
            size_px=size_px,
        ),
        times_s=torch.tensor(
            [take_number(frame, "time_s", name) for frame, name in named], dtype=torch.float64
        ),
    )
    return require_valid_path(path, "frames")


def _size_px(root: JsonObject, where: str) -> tuple[int, int]:
    height, width = (int(side) for side in take_numbers(root, "size_px", 2, where))
    if not (1 <= height <= MAX_SIDE_PX and 1 <= width <= MAX_SIDE_PX):
        raise FileFormatError(
            f"{where}: 'size_px': expected 1 to {MAX_SIDE_PX} pixels per side, got {height} and "
            f"{width}; repair the file"
        )
    return height, width


def _provenance(source: JsonObject, where: str) -> Provenance:
    """Generator, model and licence; the other fields describe the scene file."""
    return Provenance(
        generator=take_text(source, "generator", where),
        model=optional_text(source, "model", where) or "none",
        license=optional_text(source, "license", where) or "unknown",
    )


def _require_version(root: JsonObject, where: str) -> None:
    if root.get("format") != FORMAT:
        raise FileFormatError(f"{where}: expected a {FORMAT} file, got JSON of another kind")
    version = take_int(root, "version", where, least=1)
    if version > VERSION:
        raise FileFormatError(
            f"{where}: written by a newer diff4splat (version {version}, this one reads up to "
            f"{VERSION}); update diff4splat"
        )
