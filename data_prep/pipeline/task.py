"""One task: its sequences are imported, aligned, captioned and scored. Each task has own folders.

    OUT/imported/part-00007 ─ OUT/aligned/part-00007 ─ OUT/captioned/part-00007
                                                       └─ scores.jsonl in the last of them

Every step goes on where it was stopped, so a task may be killed and run again at any time.
"""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.codecs.encode import Coding
from diff4splat.data_prep.alignment.align_clip import AlignmentSettings
from diff4splat.data_prep.alignment.align_folder import AlignJob, align_folder
from diff4splat.data_prep.curation.captions.captioning import CaptionJob, write_captions
from diff4splat.data_prep.curation.hooks import Hooks
from diff4splat.data_prep.curation.score_folders import ScoringJob, score_folders
from diff4splat.data_prep.datasets.common.windows import WindowOptions
from diff4splat.data_prep.datasets.importing import ImportJob, import_dataset
from diff4splat.data_prep.datasets.registry import find_dataset
from diff4splat.data_prep.pipeline.settings import PipelineSettings
from diff4splat.data_prep.rows import ReportRow
from diff4splat.errors import ConfigError
from diff4splat.progress.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskResult:
    """What became of the clips of one task."""

    folder: Path
    """Shards of the last step."""
    clips: int
    failed: int
    """Rows of the reports that say so, over all steps."""


def run_task(settings: PipelineSettings, task: int, phases: Phases) -> TaskResult:
    """Run every step that the settings name; a bad clip is a row of a report.

    Raises:
        ConfigError: there is no such task.
        InputError, FileFormatError: nothing of the data set is there.
        OutputError: the output folder cannot be written.
        MissingExtraError: the format needs a package that is not installed.
    """
    if not 0 <= task < settings.tasks:
        raise ConfigError(f"task: expected 0 to {settings.tasks - 1}, got {task}")
    importing = import_job(settings, task)
    rows, folder = list(import_dataset(importing, phases)), importing.folder
    if settings.align is not None:
        job = align_job(settings, task, folder)
        rows += align_folder(job, phases)
        folder = job.folder
    if settings.captions is not None:
        captioning = caption_job(settings, task, folder)
        rows += write_captions(captioning, phases)
        folder = captioning.folder
    hooks = Hooks(quality=settings.score.quality)
    records = score_folders(ScoringJob(folders=(folder,), out=folder, hooks=hooks), phases)
    return TaskResult(folder=folder, clips=len(records), failed=_failed(rows))


def _failed(rows: list[ReportRow]) -> int:
    return sum(row.status == "failed" for row in rows)


def result_folder(settings: PipelineSettings) -> Path:
    """Where the parts of the last step are."""
    captioned, aligned = settings.captions is not None, settings.align is not None
    return settings.out / ("captioned" if captioned else "aligned" if aligned else "imported")


def part_folder(settings: PipelineSettings, step: str, task: int) -> Path:
    """Where a step of a task writes."""
    return settings.out / step / f"part-{task:05d}"


def import_job(settings: PipelineSettings, task: int) -> ImportJob:
    """The import of a task.

    Raises:
        ConfigError: an option is out of range.
    """
    source = settings.source
    return ImportJob(
        root=source.path,
        dataset=source.dataset,
        folder=part_folder(settings, "imported", task),
        windows=WindowOptions(
            frames=source.frames,
            step=source.step,
            max_side_px=source.max_side,
            most_tracks=source.tracks,
            most_views=source.views,
        ),
        coding=Coding(images=source.images, depth=source.depth),
        most_sequences=source.sequences,
        append=True,
        task=task,
        tasks=settings.tasks,
    )


def align_job(settings: PipelineSettings, task: int, clips: Path) -> AlignJob:
    """The alignment of what a task imported.

    Raises:
        ConfigError: the reference lacks its folder.
    """
    align = settings.align
    return AlignJob(
        clips=clips,
        folder=part_folder(settings, "aligned", task),
        reference=align.reference,
        disparity=align.disparity,
        megasam=align.megasam,
        normaliser=align.normaliser,
        settings=AlignmentSettings(method=align.method),
    )


def caption_job(settings: PipelineSettings, task: int, clips: Path) -> CaptionJob:
    """The captions of what a task has so far.

    Raises:
        ConfigError: the table names no source.
    """
    return CaptionJob(
        clips=clips,
        folder=part_folder(settings, "captioned", task),
        side_car=settings.captions.captions,
        captioner=settings.captions.captioner,
        replace_present=settings.captions.replace,
    )


def check_settings(settings: PipelineSettings) -> None:
    """Build every job once, so that a wrong value shows before the first task runs.

    Raises:
        ConfigError: a value is out of range, or a table lacks what it needs.
    """
    find_dataset(settings.source.dataset)
    import_job(settings, 0)
    if settings.align is not None:
        align_job(settings, 0, settings.out)
    if settings.captions is not None:
        caption_job(settings, 0, settings.out)
