"""The selected clips as a folder of shards: byte for byte, or completed by masks and tracks."""

from pathlib import Path

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.curation.completion import completed
from diff4splat.data_prep.curation.decisions import Decision
from diff4splat.data_prep.rows import ReportRow, failed_row, write_rows
from diff4splat.errors import InputError, MissingExtraError, OutputError
from diff4splat.progress.phases import Phases

GENERATOR, REPORT = "prepare curate", "report.csv"


def write_selection(
    decisions: list[Decision],
    folders: tuple[Path, ...],
    out: Path,
    phases: Phases,
    complete: bool = False,
) -> int:
    """Write the selected clips that ``out`` lacks, in order; returns how many it then holds.

    What became of each is in ``report.csv`` there.

    Raises:
        OutputError: ``out`` holds clips that are not selected: nothing is removed from it.
        InputError: two folders have selected clips of one name.
    """
    sources = {folder.resolve().name: ClipFolder(folder) for folder in folders}
    places = {
        name: {identifier: number for number, identifier in enumerate(source.identifiers)}
        for name, source in sources.items()
    }
    selected = [each.record for each in decisions if each.is_selected]
    names = [record.identifier for record in selected]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"shards: expected clips of different names, got '{twice}' twice")
    with ShardWriter(out, ShardOptions(generator=GENERATOR), append=True) as writer:
        odd = sorted(writer.identifiers - set(names))
        if odd:
            raise OutputError(
                f"{out}: expected a folder without other clips, got {len(odd)} that are not "
                f"selected now, such as '{odd[0]}'; choose another folder"
            )
        waiting = [record for record in selected if record.identifier not in writer.identifiers]
        rows = []
        with phases.phase("write shards", len(waiting)) as advance:
            for record in waiting:
                source = sources[record.folder]
                place = places[record.folder][record.identifier]
                rows.append(_written(source, place, writer, complete))
                advance()
    write_rows(rows, out / REPORT)
    return len(selected) - sum(row.status == "failed" for row in rows)


def _written(source: ClipFolder, position: int, writer: ShardWriter, complete: bool) -> ReportRow:
    name = source.identifiers[position]
    try:
        clip = completed(source.clip(position)) if complete else source.encoded(position)
        writer.write(clip)
    except (OutputError, MissingExtraError):
        raise
    except Exception as error:  # damaged since it was scored: no reason to end the run
        return failed_row("", name, error)
    return ReportRow(sequence="", clip=name, status="written")
