"""The selected clips as a folder of shards, copied byte for byte."""

from pathlib import Path

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.curation.decisions import Decision
from diff4splat.errors import InputError, OutputError
from diff4splat.progress.phases import Phases

GENERATOR = "prepare curate"


def write_selection(
    decisions: list[Decision], folders: tuple[Path, ...], out: Path, phases: Phases
) -> int:
    """Write the selected clips that ``out`` lacks, in order; returns how many it then holds.

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
        with phases.phase("write shards", len(waiting)) as advance:
            for record in waiting:
                source = sources[record.folder]
                position = places[record.folder][record.identifier]
                writer.write(source.encoded(position))
                advance()
    return len(selected)
