"""``meta.json``: metadata and sizes of a clip, so that a shard is readable without its manifest."""

from dataclasses import asdict
from typing import Any, get_args

from diff4splat.data.clip import ClipMetadata, Metric, ObjectNote, TrackSource
from diff4splat.data.entry import ClipEntry, entry_from_json, entry_to_json
from diff4splat.data.json_fields import (
    VERSION,
    dumps,
    loads,
    take,
    take_choice,
    take_count,
    take_number,
    take_objects,
)
from diff4splat.data.scale_record import ScaleRecord, require_valid_scale
from diff4splat.errors import FileFormatError, InputError

_FORMAT = "diff4splat-clip"
_KEPT = ("source", "caption", "metric", "objects", "timed", "track_source", "scale")
_SCALE_NUMBERS = (
    "disparity_scale",
    "disparity_shift",
    "normaliser",
    "inlier_share",
    "relative_error",
)


def encode_metadata(note: ClipMetadata, entry: ClipEntry) -> bytes:
    """Encode as JSON; equal values give equal bytes."""
    values = asdict(note)
    document = {"format": _FORMAT, "version": VERSION, **entry_to_json(entry)}
    document |= {key: values[key] for key in _KEPT}
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
    # Version 1 had no such keys.
    document = {"timed": True, "track_source": "exact", "scale": None} | document
    return ClipMetadata(
        identifier=entry.identifier,
        source=take(document, "source", str),
        dataset=entry.dataset,
        scene=entry.scene,
        license=entry.license,
        caption=take(document, "caption", str),
        metric=take_choice(document, "metric", get_args(Metric)),
        is_static=entry.is_static,
        timed=take(document, "timed", bool),
        track_source=take_choice(document, "track_source", get_args(TrackSource)),
        scale=None if document["scale"] is None else _scale(take(document, "scale", dict)),
        objects=tuple(_object(value) for value in take_objects(document, "objects")),
    )


def _scale(value: dict[str, Any]) -> ScaleRecord:
    factor = take_number(value, "factor")
    scale = ScaleRecord(
        method=take(value, "method", str),
        factor=1.0 if factor is None else factor,
        reference=take(value, "reference", str),
        **{name: take_number(value, name) for name in _SCALE_NUMBERS},
    )
    try:
        require_valid_scale(scale)
    except InputError as error:
        raise FileFormatError(str(error)) from error
    return scale


def _object(value: dict[str, Any]) -> ObjectNote:
    return ObjectNote(
        instance=take_count(value, "instance", 1, 255),
        name=take(value, "name", str),
        color=take(value, "color", str),
        motion=take(value, "motion", str),
        object_number=take_count({"object_number": 0} | value, "object_number", 0, 255),
    )
