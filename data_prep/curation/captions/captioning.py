"""Captions into clips: from side-car files, then from a user's model where none was found.

A model is named ``module:function`` and takes a ``Clip``; it returns the caption as text, or an
empty text to leave the clip without. Pixels are copied as they are stored; only ``meta.json`` is
written anew. A caption that a clip has is kept unless it is to be replaced.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.codecs.encode import EncodedClip, Member
from diff4splat.data.codecs.metadata import decode_metadata, encode_metadata
from diff4splat.data.manifest import ensure_manifest
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.curation.captions.side_car import SideCarCaptions, clean_caption
from diff4splat.data_prep.curation.hooks import load_hook
from diff4splat.data_prep.rows import ReportRow, failed_row, write_rows
from diff4splat.errors import ConfigError, MissingExtraError, OutputError
from diff4splat.progress.phases import Phases

REPORT = "captions.csv"
_METADATA = "meta.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptionJob:
    """Where captions come from."""

    clips: Path
    folder: Path
    side_car: Path | None = None
    captioner: str = ""
    replace_present: bool = False

    def __post_init__(self) -> None:
        if self.side_car is None and not self.captioner:
            raise ConfigError(
                "prepare captions: expected --captions FILE or --captioner module:function, got "
                "neither"
            )


def write_captions(job: CaptionJob, phases: Phases) -> tuple[ReportRow, ...]:
    """Copy every clip with its caption; go on where an earlier run stopped.

    Raises:
        ConfigError: the captioner cannot be loaded.
        FileFormatError: the captions or the folder of clips are damaged as a whole.
        OutputError: the folder cannot be written.
    """
    side_car = None if job.side_car is None else SideCarCaptions(job.side_car)
    captioner = load_hook(job.captioner) if job.captioner else None
    clips, rows = ClipFolder(job.clips), []
    options = ShardOptions(generator="prepare captions")
    with ShardWriter(job.folder, options, append=True) as writer:
        try:
            with phases.phase("write captions", len(clips)) as advance:
                for position in range(len(clips)):
                    rows.append(_written(job, (side_car, captioner), clips, position, writer))
                    advance()
        finally:
            write_rows(rows, job.folder / REPORT)
    ensure_manifest(job.folder, options.generator)
    return tuple(rows)


def _written(
    job: CaptionJob,
    sources: tuple[SideCarCaptions | None, Callable | None],
    clips: ClipFolder,
    position: int,
    writer: ShardWriter,
) -> ReportRow:
    name = clips.identifiers[position]
    if name in writer.identifiers:
        return ReportRow(sequence="", clip=name, status="present")
    try:
        clip = clips.encoded(position)
        note = decode_metadata(_metadata(clip), clip.entry)
        caption = note.caption
        if not caption.strip() or job.replace_present:
            caption = _found(sources, clips, position, note) or caption
        writer.write(with_caption(clip, caption))
    except (OutputError, MissingExtraError):
        raise
    except Exception as error:  # one bad clip must not end a run of days
        return failed_row("", name, error)
    return ReportRow(sequence="", clip=name, status="written" if caption else "without")


def with_caption(clip: EncodedClip, caption: str) -> EncodedClip:
    """The stored clip with another caption; all other bytes stay."""
    note = replace(decode_metadata(_metadata(clip), clip.entry), caption=caption)
    content = encode_metadata(note, clip.entry)
    members = tuple(
        Member(suffix=m.suffix, content=content if m.suffix == _METADATA else m.content)
        for m in clip.members
    )
    return replace(clip, members=members)


def _metadata(clip: EncodedClip) -> bytes:
    return next(member.content for member in clip.members if member.suffix == _METADATA)


def _found(sources, clips: ClipFolder, position: int, note) -> str:
    side_car, captioner = sources
    caption = "" if side_car is None else side_car.caption(note)
    if not caption and captioner is not None:
        caption = clean_caption(captioner(clips.clip(position)), "captioner")
    return caption


def caption_summary(rows: tuple[ReportRow, ...]) -> str:
    """How many clips have a caption now, and the first reason where one failed."""
    counts = Counter(row.status for row in rows)
    failed = next((row for row in rows if row.status == "failed"), None)
    text = (
        f"{counts['written']} clips with a caption, {counts['without']} without, "
        f"{counts['present']} present"
    )
    if failed is None:
        return text
    return f"{text}, {counts['failed']} unusable; {failed.clip}: {failed.message}"
