"""Matched sequences as folders: images, depth, masks and the exact truth about every camera.

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
    FrameFiles,
    GeometryKind,
    write_camera_record,
)
from diff4splat.io.cameras.optics_json import optics_json
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.partials import remove_abandoned
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
MAX_THUMBNAILS = 5
"""Frames of each sequence on the contact sheet."""
BLIND_GREY = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetJob:
    """One sequence of the data set."""

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
    physical_path: PhysicalPath
    kind: GeometryKind
    folder: Path


def write_camera_dataset(job: DatasetJob, folder: Path, log: RunLog) -> dict[str, CaptureStats]:
    """Film and write everything, whole or not at all; returns what each sequence needed.

    Raises:
        ConfigError: something is in the folder already.
        OutputError: the folder cannot be written, or the disk is full.
    """
    require_empty(folder)
    stats, rows = {}, []
    with atomic_folder(folder) as staging:
        for name, physical_path in job.sequences.items():
            (staging / name).mkdir()
            sequence = _Sequence(
                name=name,
                physical_path=physical_path,
                kind=geometry_kind(physical_path),
                folder=staging / name,
            )
            stats[name], row = _write_sequence(job, sequence, log)
            rows.append(row)
        write_text(staging / DATASET, json.dumps(_contents(job, stats), indent=1) + "\n")
        write_png(camera_sheet(rows, job.scene.provenance.license), staging / SHEET)
    return stats


def require_empty(folder: Path) -> None:
    """Refuse a folder with something in it: a data set is not mixed with other files.

    What a killed run left unfinished there is removed.

    Raises:
        ConfigError: naming what was found.
    """
    if folder.is_dir():
        remove_abandoned(folder)
    if folder.is_dir() and (found := sorted(path.name for path in folder.iterdir())):
        raise ConfigError(
            f"--out: expected a new or empty folder, got {folder} with {found[0]} in it; choose "
            "another"
        )


def _write_sequence(
    job: DatasetJob, sequence: _Sequence, log: RunLog
) -> tuple[CaptureStats, SheetRow]:
    stats, images = CaptureStats(), []
    count = len(sequence.physical_path)
    shown = set(torch.linspace(0, count - 1, min(count, MAX_THUMBNAILS)).round().int().tolist())
    with log.phases.phase(sequence.name, count) as advance:
        frames = render_photographs(
            freeze_time(job.scene, job.time_s),
            sequence.physical_path,
            ("rgb", sequence.kind),
            job.settings,
            advance,
            stats,
        )
        files = []
        for index, photo in enumerate(frames):
            files.append(_write_frame(sequence, index, photo))
            if index in shown:
                images.append((sequence.physical_path.time_s(index), thumbnail(_shown(photo))))
    blind = stats.valid is not None and not bool(stats.valid.all())
    if blind:
        write_png(stats.valid[..., None].expand(-1, -1, 3).float(), sequence.folder / VALID)
    record = CameraRecord(
        effect=sequence.name,
        physical_path=sequence.physical_path,
        frames=tuple(files),
        geometry=sequence.kind,
        settings=replace(job.settings, samples=stats.samples),
        scene=job.scene.provenance,
        generator=f"diff4splat {__version__}",
        valid=VALID if blind else None,
        scene_time_s=job.time_s,
        intervals=stats.intervals,
        interval_error_px=stats.interval_error_px,
    )
    write_camera_record(record, sequence.folder / FILE)
    return stats, SheetRow(name=sequence.name, facts=stats.lines()[0], images=tuple(images))


def _shown(photo: Photograph) -> Float[Tensor, "h w 3"]:
    """The image, grey where the lens sees nothing."""
    return torch.where(photo.valid[..., None], photo.rgb, BLIND_GREY)


def _write_frame(sequence: _Sequence, index: int, photo: Photograph) -> FrameFiles:
    files = FrameFiles(
        image=f"frame_{index:04d}.png", geometry=f"{sequence.kind}/frame_{index:04d}.exr"
    )
    write_png(photo.rgb, sequence.folder / files.image)
    at = slice(index, index + 1)
    path = sequence.physical_path.path
    write_depth_exr(
        getattr(photo, sequence.kind)[None],
        replace(path, cameras=path.cameras[at], times_s=path.times_s[at]),
        sequence.folder / files.geometry,
        quantity=sequence.kind,
        optics=json.dumps(optics_json(sequence.physical_path.optics)),
    )
    return files


def _contents(job: DatasetJob, stats: Mapping[str, CaptureStats]) -> dict[str, object]:
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
                "size_px": list(physical_path.path.cameras.size_px),
                "geometry": geometry_kind(physical_path),
                "samples": stats[name].samples,
                "intervals": stats[name].intervals,
                "interval_error_px": stats[name].interval_error_px,
                "blind_share": stats[name].blind_share,
                "left_out": list(stats[name].skipped_effects),
            }
            for name, physical_path in job.sequences.items()
        ],
    }
