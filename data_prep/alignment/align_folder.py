"""Every clip of a folder with metric depth; what cannot be aligned becomes a row of a report."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.manifest import ensure_manifest
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.alignment.align_clip import AlignmentSettings, align_clip
from diff4splat.data_prep.alignment.opencv.flow_disparity import flow_disparity
from diff4splat.data_prep.alignment.references.megasam_depth import megasam_reference
from diff4splat.data_prep.alignment.references.reference import Reference, aligned_metric
from diff4splat.data_prep.alignment.references.stereo import stereo_reference
from diff4splat.data_prep.alignment.references.track_depth import track_reference
from diff4splat.data_prep.alignment.references.triangulation import triangulation_reference
from diff4splat.data_prep.alignment.tool_files.megasam import find_megasam, read_megasam
from diff4splat.data_prep.alignment.tool_files.video_depth_anything import (
    find_disparity,
    read_disparity,
)
from diff4splat.data_prep.rows import ReportRow, failed_row, write_rows
from diff4splat.errors import ConfigError, InputError, MissingExtraError, OutputError
from diff4splat.progress.phases import Phases

ReferenceName = Literal["depth", "tracks", "stereo", "triangulation", "megasam"]
REPORT = "alignment.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignJob:
    """What to align to what."""

    clips: Path
    folder: Path
    reference: ReferenceName
    disparity: Path | None = None
    """Folder of Video Depth Anything's files; None takes disparity from optical flow."""
    megasam: Path | None = None
    normaliser: float | None = None
    settings: AlignmentSettings = field(default_factory=AlignmentSettings)

    def __post_init__(self) -> None:
        if self.reference == "megasam" and self.megasam is None:
            raise ConfigError("--reference megasam: expected --megasam FOLDER, got none; name it")


def align_folder(job: AlignJob, phases: Phases) -> tuple[ReportRow, ...]:
    """Write every accepted clip; go on where an earlier run stopped.

    Raises:
        OutputError: the folder cannot be written.
        FileFormatError: the folder of clips is damaged.
    """
    clips, rows = ClipFolder(job.clips), []
    options = ShardOptions(generator="prepare align")
    with ShardWriter(job.folder, options, append=True) as writer:
        try:
            with phases.phase("align clips", len(clips)) as advance:
                for position, name in enumerate(clips.identifiers):
                    present = name in writer.identifiers
                    rows.append(
                        ReportRow(sequence="", clip=name, status="present")
                        if present
                        else _written(job, clips, position, writer)
                    )
                    advance()
        finally:
            write_rows(rows, job.folder / REPORT)
    ensure_manifest(job.folder, options.generator)
    return tuple(rows)


def _written(job: AlignJob, clips: ClipFolder, position: int, writer: ShardWriter) -> ReportRow:
    name = clips.identifiers[position]
    try:
        clip = clips.clip(position)
        found = align_clip(clip, _disparity(job, clip), _reference(job, clip), job.settings)
        if found.refused:
            raise InputError("; ".join(found.refused))
        writer.write(found.clip)
    except (OutputError, MissingExtraError):
        raise
    except Exception as error:  # one bad clip must not end a run of days
        return failed_row("", name, error)
    return ReportRow(sequence="", clip=name, status="written")


def _disparity(job: AlignJob, clip: Clip) -> np.ndarray:
    if job.disparity is None:
        return flow_disparity(clip.views[0])
    return read_disparity(find_disparity(job.disparity, clip.note.identifier))


def _reference(job: AlignJob, clip: Clip) -> Reference:
    if job.reference == "megasam":
        scene = read_megasam(find_megasam(job.megasam, clip.note.identifier))
        return megasam_reference(clip, scene, job.normaliser)
    sources: dict[str, Callable[[Clip], Reference]] = {
        "depth": _own_depth,
        "tracks": track_reference,
        "stereo": stereo_reference,
        "triangulation": triangulation_reference,
    }
    return sources[job.reference](clip)


def _own_depth(clip: Clip) -> Reference:
    """The depth that the clip has: sparse, or of a sensor."""
    depth = clip.views[0].depth
    if depth is None:
        raise InputError(
            "reference depth: expected a clip with depth, got none; choose tracks, stereo or "
            "triangulation"
        )
    return Reference(depth=depth.numpy(), name="depth", metric=aligned_metric(clip.note.metric))


def alignment_summary(rows: tuple[ReportRow, ...]) -> str:
    """How many clips were written, present and refused, and the first reason."""
    counts = Counter(row.status for row in rows)
    failed = next((row for row in rows if row.status == "failed"), None)
    text = f"{counts['written']} clips aligned, {counts['present']} present"
    return (
        text
        if failed is None
        else f"{text}, {counts['failed']} not; {failed.clip}: {failed.message}"
    )
