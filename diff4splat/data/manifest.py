"""``manifest.json``: what a folder of shards holds. It is written last: without it, no set.

``shards`` lists every shard with its size in bytes and, in order, its clips; ``sources`` and
``licenses`` are the different ones among all clips. ``generator`` is what wrote the folder.
"""

import re
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from diff4splat.data.entry import ClipEntry, entry_from_json, entry_to_json
from diff4splat.data.json_fields import VERSION, dumps, load_file, take, take_objects
from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import write_text

MANIFEST = "manifest.json"
_FORMAT = "diff4splat-clips"
_SHARD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*\.tar")
_CONVENTIONS = {
    "axes": "x right, y down, z forward (OpenCV), right-handed; world = first camera of view 0",
    "depth": "along the optical axis, 0 where unknown",
    "pixels": "centres at +0.5; uv and flow are (x, y)",
    "poses": "world_from_camera, for column vectors",
    "times": "seconds",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ShardEntry:
    """One tar."""

    name: str
    size: int
    """Bytes."""
    clips: tuple[ClipEntry, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """A whole folder."""

    generator: str
    sources: tuple[str, ...]
    """Sorted."""
    shards: tuple[ShardEntry, ...]

    @property
    def clips(self) -> tuple[ClipEntry, ...]:
        """Every clip in the order of the shards."""
        return tuple(chain.from_iterable(shard.clips for shard in self.shards))


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write it whole or not at all."""
    shards = [
        {
            "name": shard.name,
            "size": shard.size,
            "count": len(shard.clips),
            "clips": [entry_to_json(clip) for clip in shard.clips],
        }
        for shard in manifest.shards
    ]
    document = {
        "format": _FORMAT,
        "version": VERSION,
        "conventions": _CONVENTIONS,
        "generator": manifest.generator,
        "sources": list(manifest.sources),
        "licenses": sorted({clip.license for clip in manifest.clips}),
        "shards": shards,
    }
    write_text(folder / MANIFEST, dumps(document))


def ensure_manifest(folder: Path, generator: str) -> None:
    """A manifest without clips where there is none: the folder of a task that had nothing to do."""
    if not (folder / MANIFEST).exists():
        write_manifest(Manifest(generator=generator, sources=(), shards=()), folder)


def read_manifest(folder: Path) -> Manifest:
    """What ``folder`` holds.

    Raises:
        FileFormatError: missing, damaged, of a newer version, or naming something unsafe or twice.
    """
    file = folder / MANIFEST
    document = load_file(file, _FORMAT)
    try:
        sources = take(document, "sources", list)
        if not all(isinstance(source, str) for source in sources):
            raise FileFormatError("'sources': expected a list of texts, got something else in it")
        manifest = Manifest(
            generator=take(document, "generator", str),
            sources=tuple(sources),
            shards=tuple(_shard(value) for value in take_objects(document, "shards")),
        )
        _require_unique([shard.name for shard in manifest.shards], "shard")
        _require_unique([clip.identifier for clip in manifest.clips], "clip")
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    return manifest


def _shard(value: dict[str, Any]) -> ShardEntry:
    name = take(value, "name", str)
    if not _SHARD.fullmatch(name):
        raise FileFormatError(f"'name': expected a shard like 'shard-00000.tar', got {name[:60]!r}")
    clips = tuple(entry_from_json(clip) for clip in take_objects(value, "clips"))
    if take(value, "count", int) != len(clips):
        raise FileFormatError(
            f"{name}: expected {value['count']} clips by its count, got {len(clips)}; copy it again"
        )
    return ShardEntry(name=name, size=take(value, "size", int), clips=clips)


def _require_unique(names: list[str], what: str) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise FileFormatError(f"expected every {what} once, got '{name}' twice")
        seen.add(name)
