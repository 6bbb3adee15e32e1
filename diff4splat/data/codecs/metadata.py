"""``meta.json``: metadata and sizes of a clip, so that a shard is readable without its manifest."""

from dataclasses import asdict
from typing import Any, get_args

from diff4splat.data.clip import ClipMetadata, Metric, ObjectNote
from diff4splat.data.entry import ClipEntry, entry_from_json, entry_to_json
from diff4splat.data.json_fields import VERSION, dumps, loads, take, take_count, take_objects
from diff4splat.errors import FileFormatError

_FORMAT = "diff4splat-clip"


def encode_metadata(note: ClipMetadata, entry: ClipEntry) -> bytes:
    """Encode as JSON; equal values give equal bytes."""
    values = asdict(note)
    document = {"format": _FORMAT, "version": VERSION, **entry_to_json(entry)}
    document |= {key: values[key] for key in ("source", "caption", "metric", "objects")}
    return dumps(document).encode()


def decode_metadata(content: bytes, entry: ClipEntry) -> ClipMetadata:
    """Decode the metadata of the clip that ``entry`` describes.

    Raises:
        FileFormatError: damaged, of another version, or of a clip that the entry does not describe.
    """
    document = loads(content, _FORMAT)
    if entry_from_json(document) != entry:
        raise FileFormatError(
            f"expected the clip of the manifest, {entry_to_json(entry)}, got other values; "
            "manifest and shard are of different sets, copy both again"
        )
    return ClipMetadata(
        identifier=entry.identifier,
        source=take(document, "source", str),
        license=entry.license,
        caption=take(document, "caption", str),
        metric=_metric(take(document, "metric", str)),
        is_static=entry.is_static,
        objects=tuple(_object(value) for value in take_objects(document, "objects")),
    )


def _metric(value: str) -> Metric:
    if value not in get_args(Metric):
        known = ", ".join(get_args(Metric))
        raise FileFormatError(f"'metric': expected one of {known}, got {value[:60]!r}")
    return value


def _object(value: dict[str, Any]) -> ObjectNote:
    return ObjectNote(
        instance=take_count(value, "instance", 1, 255),
        name=take(value, "name", str),
        color=take(value, "color", str),
        motion=take(value, "motion", str),
    )
