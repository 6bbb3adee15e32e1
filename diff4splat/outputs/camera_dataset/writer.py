"""Matched sequences as folders: pictures, depth, masks and the exact truth about every camera.

    out/dataset.json  out/contact-sheet.png
    out/<effect>/camera.json  frame_0000.png …  depth/frame_0000.exr …  valid.png

A lens that looks sideways or behind itself has ``distance/`` in place of ``depth/``; ``valid.png``
is there where a lens sees nothing somewhere, and black there. One frame is in memory at a time.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import ConfigError
from diff4splat.io.atomic import atomic_folder, write_text
from diff4splat.io.cameras.camera_record import (
    FILE,
    CameraRecord,
    FrameRecord,
    GeometryKind,
    write_camera_record,
)
from diff4splat.io.cameras.optics_json import optics_json
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.photos.images import write_png
from diff4splat.outputs.camera_dataset.sheet import SheetRow, camera_sheet, thumbnail
from diff4splat.outputs.photo_sequence import (
    CaptureStats,
    freeze_time,
    geometry_kind,
    render_photographs,
)
from diff4splat.paths.physical_path import PhysicalPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.scene.scene import Scene

FORMAT, VERSION = "diff4splat-camera-dataset", 1
DATASET, SHEET, VALID = "dataset.json", "contact-sheet.png", "valid.png"
SHOWN = 5
"""Frames of each sequence on the contact sheet."""
BLIND_GREY = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetJob:
    """What is filmed."""

    scene: Scene
    sequences: Mapping[str, PhysicalPath]
    """By the name of the folder."""
    settings: PhotoSettings
    time_s: float | None = None
    """Stop the clock of the scene there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sequence:
    """One of them, while it is being written."""

    name: str
    filmed: PhysicalPath
    kind: GeometryKind
    folder: Path


def write_camera_dataset(job: DatasetJob, folder: Path, log: RunLog) -> dict[str, CaptureStats]:
    """Film and write everything, whole or not at all; returns what each sequence needed.

    Raises:
        ConfigError: something is in the folder already.
        OutputError: the folder cannot be written, or the disk is full.
    """
    require_empty(folder)
    taken, rows = {}, []
    with atomic_folder(folder) as staging:
        for name, filmed in job.sequences.items():
            (staging / name).mkdir()
            own = _Sequence(
                name=name, filmed=filmed, kind=geometry_kind(filmed), folder=staging / name
            )
            taken[name], row = _write_sequence(job, own, log)
            rows.append(row)
        write_text(staging / DATASET, json.dumps(_contents(job, taken), indent=1) + "\n")
        write_png(camera_sheet(rows, job.scene.provenance.license), staging / SHEET)
    return taken


def require_empty(folder: Path) -> None:
    """Refuse a folder with something in it: a data set is not mixed with other files.

    Raises:
        ConfigError: naming what was found.
    """
    if folder.is_dir() and (found := sorted(path.name for path in folder.iterdir())):
        raise ConfigError(
            f"--out: expected a new or empty folder, got {folder} with {found[0]} in it; choose "
            "another"
        )


def _write_sequence(job: DatasetJob, own: _Sequence, log: RunLog) -> tuple[CaptureStats, SheetRow]:
    taken, pictures = CaptureStats(), []
    count = len(own.filmed)
    shown = set(torch.linspace(0, count - 1, min(count, SHOWN)).round().int().tolist())
    with log.phases.phase(own.name, count) as advance:
        frames = render_photographs(
            freeze_time(job.scene, job.time_s),
            own.filmed,
            ("rgb", own.kind),
            job.settings,
            advance,
            taken,
        )
        files = []
        for index, photo in enumerate(frames):
            files.append(_write_frame(own, index, photo))
            if index in shown:
                pictures.append((own.filmed.time_s(index), thumbnail(_shown(photo))))
    blind = taken.valid is not None and not bool(taken.valid.all())
    if blind:
        write_png(taken.valid[..., None].expand(-1, -1, 3).float(), own.folder / VALID)
    record = CameraRecord(
        effect=own.name,
        filmed=own.filmed,
        frames=tuple(files),
        geometry=own.kind,
        settings=replace(job.settings, samples=taken.samples),
        scene=job.scene.provenance,
        generator=f"diff4splat {__version__}",
        valid=VALID if blind else None,
        scene_time_s=job.time_s,
        intervals=taken.intervals,
        interval_error_px=taken.interval_error_px,
    )
    write_camera_record(record, own.folder / FILE)
    return taken, SheetRow(name=own.name, facts=taken.lines()[0], pictures=tuple(pictures))


def _shown(photo: Photograph) -> Float[Tensor, "h w 3"]:
    """The picture, grey where the lens sees nothing."""
    return torch.where(photo.valid[..., None], photo.rgb, BLIND_GREY)


def _write_frame(own: _Sequence, index: int, photo: Photograph) -> FrameRecord:
    files = FrameRecord(
        picture=f"frame_{index:04d}.png", geometry=f"{own.kind}/frame_{index:04d}.exr"
    )
    write_png(photo.rgb, own.folder / files.picture)
    at = slice(index, index + 1)
    path = own.filmed.path
    write_depth_exr(
        getattr(photo, own.kind)[None],
        replace(path, cameras=path.cameras[at], times_s=path.times_s[at]),
        own.folder / files.geometry,
        quantity=own.kind,
        optics=json.dumps(optics_json(own.filmed.optics)),
    )
    return files


def _contents(job: DatasetJob, taken: Mapping[str, CaptureStats]) -> dict[str, object]:
    """What lies where."""
    first = next(iter(job.sequences.values()))
    return {
        "format": FORMAT,
        "version": VERSION,
        "generator": f"diff4splat {__version__}",
        "license": job.scene.provenance.license,
        "scene": asdict(job.scene.provenance),
        "frames": len(first),
        "times_s": first.path.times_s.tolist(),
        "contact_sheet": SHEET,
        "sequences": [
            {
                "name": name,
                "cameras": f"{name}/{FILE}",
                "size_px": list(filmed.path.cameras.size_px),
                "geometry": geometry_kind(filmed),
                "samples": taken[name].samples,
                "intervals": taken[name].intervals,
                "interval_error_px": taken[name].interval_error_px,
                "blind_share": taken[name].blind_share,
                "left_out": list(taken[name].left_out),
            }
            for name, filmed in job.sequences.items()
        ],
    }
