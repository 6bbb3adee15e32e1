"""Where each member lies in a shard: ``<shard>.index.json`` beside ``<shard>.tar``.

Offsets and sizes are bytes of the member's content in the tar, checksums are CRC-32 (against
damage, not against malice). With it a clip is one open and a few seeks.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff4splat.data.json_fields import IDENTIFIER, VERSION, dumps, load_file, take
from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import write_text

_FORMAT = "diff4splat-shard-index"
_SUFFIX = re.compile(r"[a-z]+[0-9]{0,2}\.[a-z0-9]+")
_BLOCK = 512
"""Bytes; contents begin at multiples of it, after a header of one block."""


@dataclass(frozen=True, slots=True)
class Slot:
    """One member's place."""

    offset: int
    size: int
    crc32: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ShardIndex:
    """Places by clip and by suffix (``rgb00.png``)."""

    clips: dict[str, dict[str, Slot]]


def index_file(shard: Path) -> Path:
    """``a.index.json`` of ``a.tar``."""
    return shard.with_suffix(".index.json")


def write_index(index: ShardIndex, shard: Path) -> None:
    """Write the index of ``shard`` whole or not at all."""
    clips = {
        identifier: {suffix: [slot.offset, slot.size, slot.crc32] for suffix, slot in slots.items()}
        for identifier, slots in index.clips.items()
    }
    document = {"format": _FORMAT, "version": VERSION, "shard": shard.name, "clips": clips}
    write_text(index_file(shard), dumps(document))


def read_index(shard: Path, size: int) -> ShardIndex:
    """The index of ``shard``, a file of ``size`` bytes.

    Raises:
        FileFormatError: missing, damaged, of another shard, or with places outside of it.
    """
    file = index_file(shard)
    document = load_file(file, _FORMAT)
    try:
        if take(document, "shard", str) != shard.name:
            raise FileFormatError(
                f"expected the index of {shard.name}, got that of {document['shard'][:60]!r}"
            )
        clips = {
            _named(identifier): {_named_member(suffix): _slot(v, size) for suffix, v in slots}
            for identifier, slots in _items(take(document, "clips", dict))
        }
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}; copy shard and index again") from error
    return ShardIndex(clips=clips)


def _items(clips: dict[str, Any]) -> list[tuple[str, list[tuple[str, Any]]]]:
    if not all(isinstance(slots, dict) for slots in clips.values()):
        raise FileFormatError("'clips': expected an object of objects, got something else in it")
    return [(identifier, list(slots.items())) for identifier, slots in clips.items()]


def _named(identifier: str) -> str:
    if not IDENTIFIER.fullmatch(identifier):
        raise FileFormatError(f"expected plain names of clips, got {identifier[:60]!r}")
    return identifier


def _named_member(suffix: str) -> str:
    if not _SUFFIX.fullmatch(suffix):
        raise FileFormatError(f"expected members like 'rgb00.png', got {suffix[:60]!r}")
    return suffix


def _slot(values: Any, size: int) -> Slot:
    whole = isinstance(values, list) and len(values) == 3 and all(type(v) is int for v in values)
    if not whole or min(values) < 0:
        raise FileFormatError(f"expected [offset, size, crc32], got {repr(values)[:60]}")
    slot = Slot(*values)
    if slot.offset < _BLOCK or slot.offset % _BLOCK or slot.offset + slot.size > size:
        raise FileFormatError(
            f"expected members within the {size} bytes of the shard, "
            f"got {slot.size} at {slot.offset}"
        )
    return slot
