"""Physical cameras of this library: ``camera.json`` and images of one or several cameras.

    folder/camera.json                      one camera
    folder/<camera>/camera.json             several
    folder/<effect>/camera.json             a data set of one camera: ``clip`` names the effect
    folder/<camera>/<effect>/camera.json    data sets of several: the same

All cameras of a capture share their optics. Poses are OpenCV ``world_from_camera``; see
``io.camera_record``.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.data_prep.readers.common.assembly import assemble_capture
from diff4splat.data_prep.readers.common.downscale_optics import downscale_optics
from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.common.test_split import choose_test_split
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.files.depth_file import DepthFile
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation, resolve_inside
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.native.camera_folders import camera_folders
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import FileFormatError
from diff4splat.geometry.optics import Optics
from diff4splat.io.cameras.camera_record import FILE, CameraRecord, read_camera_record
from diff4splat.io.cameras.optics_json import optics_json

EXPECTED_FILES = "camera.json beside its images, or folders of these (diff4splat render --dataset)"

_ROUNDING = 1e-4
"""Largest deviation of a frame from the track, in rotation entries and shares of distance."""


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    return camera_folders(folder).has_cameras


def read(location: CaptureLocation, options: ReadOptions) -> Capture:
    """Read the capture.

    Raises:
        FileFormatError: naming the file and value, or what differs between the cameras.
        ConfigError: no such effect or camera, or a downscale that the shutter does not allow.
    """
    folders = camera_folders(location.folder).select(options.clip, location.name)
    records = [read_camera_record(folder / FILE) for folder in folders]
    _require_same_optics(records, folders)
    shots = [
        shot
        for number, (record, folder) in enumerate(zip(records, folders, strict=True))
        for shot in _shots(record, folder, number)
    ]
    shots, reason = choose_test_split(shots, options.hold_out, location.name)
    shots, repeated = _without_repeats(shots)
    first = records[0]
    undecoded = UndecodedCapture(
        name=location.name,
        source="diff4splat cameras",
        shots=shots,
        split_reason=reason,
        shrink=options.downscale,
        background=options.background,
        notes=(*_notes(records, folders), *repeated),
    )
    capture = replace(assemble_capture(undecoded, options), license=_licenses(records))
    optics = first.physical_path.optics
    if optics_json(optics) == optics_json(Optics()):
        return capture
    height, width = first.physical_path.path.cameras.size_px
    tracks = {number: record.physical_path.track for number, record in enumerate(records)}
    return replace(
        capture,
        optics=downscale_optics(optics, (height, width), options.downscale, location.name),
        tracks={number: track for number, track in tracks.items() if track is not None},
    )


def _shots(record: CameraRecord, folder: Path, number: int) -> list[Shot]:
    _require_frames_on_track(record, folder / FILE)
    path, where = record.physical_path.path, str(folder / FILE)
    mask = None if record.valid is None else _existing(folder, record.valid, where)
    return [
        Shot(
            image=ImageFile(file=_existing(folder, taken.image, where)),
            lens=Intrinsics(
                focal_px=tuple(path.cameras.focal_px[index].tolist()),
                center_px=tuple(path.cameras.center_px[index].tolist()),
                size_px=path.cameras.size_px,
            ),
            world_from_camera=path.cameras.world_from_camera[index],
            time_s=record.physical_path.time_s(index),
            camera=number,
            mask=mask,
            depth=None
            if taken.geometry is None or record.geometry != "depth"
            else DepthFile(file=_existing(folder, taken.geometry, where)),
        )
        for index, taken in enumerate(record.frames)
    ]


def _existing(folder: Path, name: str, where: str) -> Path:
    file = resolve_inside(folder, name, where)
    if not file.is_file():
        raise FileFormatError(f"{where}: expected the file {file}, got no such file; copy it again")
    return file


def _require_frames_on_track(record: CameraRecord, file: Path) -> None:
    """Require frame poses that agree with the camera track.

    Raises:
        FileFormatError: naming the first that is not.
    """
    track, path = record.physical_path.track, record.physical_path.path
    if track is None:
        return
    expected, got = track.at(path.times_s), path.cameras.world_from_camera
    size = torch.ones(4, 4, dtype=torch.float64)
    size[:3, 3] = got[:, :3, 3].abs().max().clamp_min(1.0)
    far = ((expected - got).abs() > _ROUNDING * size).flatten(1).any(1)
    if bool(far.any()):
        raise FileFormatError(
            f"{file}: frame {int(far.int().argmax())}: expected the pose that 'track' has at its "
            "time, got another; repair one of them"
        )


def _require_same_optics(records: Sequence[CameraRecord], folders: Sequence[Path]) -> None:
    """Require one lens, aperture, shutter and exposure for all cameras.

    Raises:
        FileFormatError: naming what differs, and where.
    """
    known = _flat(optics_json(records[0].physical_path.optics))
    for record, folder in zip(records[1:], folders[1:], strict=True):
        other = _flat(optics_json(record.physical_path.optics))
        for key in {**known, **other}:
            mine, theirs = known.get(key), other.get(key)
            if mine != theirs:
                raise FileFormatError(
                    f"{folder / FILE}: expected the optics of {folders[0] / FILE}, since cameras "
                    f"of one capture share them, got {key} {theirs} in place of {mine}; read one "
                    "of them alone, or choose one effect (clip)"
                )


def _flat(value: object, name: str = "optics") -> dict[str, object]:
    """Values by dotted names, without the redundant formulas."""
    if not isinstance(value, dict):
        return {name: value}
    own = ((key, inner) for key, inner in value.items() if key != "formula")
    return {k: v for key, inner in own for k, v in _flat(inner, f"{name}.{key}").items()}


def _without_repeats(shots: list[Shot]) -> tuple[list[Shot], tuple[str, ...]]:
    """Drop held-out frames whose view and time are in training; paths often share a start."""
    training = {_view_key(shot) for shot in shots if not shot.held_out}
    kept = [shot for shot in shots if not (shot.held_out and _view_key(shot) in training)]
    left = len(shots) - len(kept)
    note = f"{left} held-out images were left out: training sees the same view at the same time"
    return kept, (note,) if left else ()


def _view_key(shot: Shot) -> tuple[float, ...]:
    return (shot.time_s, *shot.world_from_camera.flatten().tolist())


def _licenses(records: Sequence[CameraRecord]) -> str:
    return "; ".join(sorted({record.scene.license for record in records}))


def _notes(records: Sequence[CameraRecord], folders: Sequence[Path]) -> tuple[str, ...]:
    names = ", ".join(f"{folder.name} is {number}" for number, folder in enumerate(folders))
    if len({folder.name for folder in folders}) < len(folders):
        names = ", ".join(f"{one.parent.name} is {number}" for number, one in enumerate(folders))
    done = {
        f"cameras count from 0 in the order of their folders: {names}": len(folders) > 1,
        "distances were left out: depth is z": records[0].geometry == "distance",
        "pixels where the lens sees nothing do not count": records[0].valid is not None,
    }
    return tuple(note for note, holds in done.items() if holds)
