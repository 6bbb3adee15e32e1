"""What is known of a clip without opening it: one entry of the manifest."""

from dataclasses import dataclass
from typing import Any

from diff4splat.data import json_fields
from diff4splat.data.clip import Clip
from diff4splat.data.json_fields import take, take_count
from diff4splat.errors import FileFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipEntry:
    """Sizes and rights of one clip."""

    identifier: str
    frames: int
    size_px: tuple[int, int]
    """(height, width)"""
    views: int
    tracks: int
    """How many points are tracked; 0 when none are."""
    is_static: bool
    license: str


def entry_of(clip: Clip) -> ClipEntry:
    """The entry that describes ``clip``."""
    return ClipEntry(
        identifier=clip.note.identifier,
        frames=clip.frames,
        size_px=clip.size_px,
        views=len(clip.views),
        tracks=0 if clip.tracks is None else len(clip.tracks.instances),
        is_static=clip.note.is_static,
        license=clip.note.license,
    )


def entry_to_json(entry: ClipEntry) -> dict[str, Any]:
    """The entry as JSON values."""
    return {
        "id": entry.identifier,
        "frames": entry.frames,
        "size_px": list(entry.size_px),
        "views": entry.views,
        "tracks": entry.tracks,
        "static": entry.is_static,
        "license": entry.license,
    }


def entry_from_json(source: dict[str, Any]) -> ClipEntry:
    """The entry out of JSON values.

    Raises:
        FileFormatError: a value is missing, of another type, or absurd.
    """
    size = take(source, "size_px", list)
    sane = [type(side) is int and 1 <= side <= json_fields.MAX_SIDE_PX for side in size]
    if len(size) != 2 or not all(sane):
        raise FileFormatError(
            f"'size_px': expected height and width from 1 to {json_fields.MAX_SIDE_PX}, "
            f"got {repr(size)[:60]}"
        )
    return ClipEntry(
        identifier=json_fields.take_identifier(source, "id"),
        frames=take_count(source, "frames", 1, json_fields.MAX_FRAMES),
        size_px=(size[0], size[1]),
        views=take_count(source, "views", 1, json_fields.MAX_VIEWS),
        tracks=take_count(source, "tracks", 0, json_fields.MAX_TRACKS),
        is_static=take(source, "static", bool),
        license=take(source, "license", str),
    )
