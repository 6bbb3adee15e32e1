"""Open the clips of a protocol: procedural worlds of one seed, or a folder of shards."""

from dataclasses import dataclass

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol
from diff4splat.evaluation.protocols.sources import ClipSource
from diff4splat.training.batches.sources import EndlessClips, open_source
from diff4splat.training.recipe.data import DataSettings, SourceSettings


@dataclass(frozen=True, slots=True)
class FirstWorlds:
    """The first ``count`` clips of an endless source."""

    worlds: EndlessClips
    count: int

    def __len__(self) -> int:
        return self.count

    def clip(self, index: int) -> Clip:
        """Generate and render one world."""
        return self.worlds.clip(index)


def open_clips(loaded: LoadedProtocol) -> ClipSource:
    """Open the clip source of a protocol.

    Raises:
        InputError, FileFormatError: the folder has no valid shards.
    """
    protocol = loaded.protocol
    if protocol.source.kind == "shards":
        return ClipFolder(loaded.folder / protocol.source.folder)
    return FirstWorlds(_worlds(protocol), protocol.source.first + protocol.source.count)


def _worlds(protocol: Protocol) -> EndlessClips:
    source = protocol.source
    settings = SourceSettings(kind="worlds", split=source.split, still_share=source.still_share)
    data = DataSettings(
        size_px=protocol.size_px,
        frames=protocol.frames,
        views=protocol.views,
        tracks=protocol.tracks,
    )
    return open_source(settings, data, source.seed)
