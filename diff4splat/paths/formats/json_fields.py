"""Typed fields out of JSON, with messages that name file, frame and key."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.checks import finite_number, finite_numbers, require_pose_count
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.paths.messages import quoted

_LARGEST_SIDE_PX = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRecord:
    """One entry of a list of frames."""

    fields: dict[str, object]
    label: str
    """``frame 3``, counted from 0."""
    where: str
    """File and label, for messages."""


def load_object(text: str, name: str) -> dict[str, object]:
    """The top-level object of a JSON text.

    Raises:
        FileFormatError: not JSON, or JSON of another kind.
    """
    try:
        root = decode_json(text)
    except FileFormatError as error:
        raise FileFormatError(f"{name}: {error}") from None
    if not isinstance(root, dict):
        raise FileFormatError(
            f"{name}: expected a JSON object with frames or camera_path, got {kind_of(root)}; "
            "check that this is the file you meant"
        )
    return root


def frame_records(root: dict[str, object], key: str, name: str) -> list[FrameRecord]:
    """The list of objects under ``key``: as many as there are poses.

    Raises:
        FileFormatError: missing, no list, empty, too long, or with entries that are no objects.
    """
    values = root.get(key)
    if not isinstance(values, list):
        raise FileFormatError(
            f"{name}: expected a list under '{key}', got {kind_of(values)}; repair the file"
        )
    require_pose_count(len(values), name)
    return [_frame_record(value, index, name) for index, value in enumerate(values)]


def _frame_record(value: object, index: int, name: str) -> FrameRecord:
    label = f"frame {index}"
    if not isinstance(value, dict):
        raise FileFormatError(
            f"{name}: {label}: expected an object, got {kind_of(value)}; repair the file"
        )
    return FrameRecord(fields=value, label=label, where=f"{name}: {label}")


def optional_number(record: Mapping[str, object], key: str, where: str) -> float | None:
    """The number under ``key``, or None when it is missing or null."""
    value = record.get(key)
    if isinstance(value, str):
        raise FileFormatError(
            f"{where}: '{key}': expected a number, got the text {quoted(value)}; remove the quotes"
        )
    return None if value is None else finite_number(value, f"{where}: '{key}'")


def numbers(record: Mapping[str, object], key: str, count: int, where: str) -> list[float]:
    """Exactly ``count`` numbers under ``key``.

    Raises:
        FileFormatError: missing, another kind or another length.
    """
    return number_list(record.get(key), count, f"{where}: '{key}'")


def number_list(values: object, count: int, where: str) -> list[float]:
    """``values`` as exactly ``count`` numbers."""
    if not isinstance(values, list) or len(values) != count:
        raise FileFormatError(f"{where}: expected a list of {count} numbers, got {kind_of(values)}")
    for value in values:
        if isinstance(value, str):
            raise FileFormatError(f"{where}: expected a number, got the text {quoted(value)}")
    return finite_numbers(values, where)


def image_side(record: Mapping[str, object], key: str, where: str) -> int | None:
    """An image width or height in pixels, or None when missing."""
    value = optional_number(record, key, where)
    if value is not None and not (value == int(value) and 1 <= value <= _LARGEST_SIDE_PX):
        raise FileFormatError(
            f"{where}: '{key}': expected a whole number of pixels from 1 to {_LARGEST_SIDE_PX}, "
            f"got {value:g}"
        )
    return None if value is None else int(value)


def image_size(
    record: Mapping[str, object], keys: tuple[str, str], where: str
) -> tuple[int, int] | None:
    """(height, width) under ``keys``, or None when both are missing.

    Raises:
        FileFormatError: only one of the two is given.
    """
    height, width = (image_side(record, key, where) for key in keys)
    if (height is None) != (width is None):
        raise FileFormatError(
            f"{where}: expected both '{keys[0]}' and '{keys[1]}' or neither; add the other"
        )
    return None if height is None or width is None else (height, width)


def number_for_all(frames: list[FrameRecord], key: str, name: str) -> Float[Tensor, " t"] | None:
    """The numbers under ``key`` when every frame has one, None when no frame has.

    Raises:
        FileFormatError: some frames have one; names the first without.
    """
    values = [optional_number(frame.fields, key, frame.where) for frame in frames]
    present = [value for value in values if value is not None]
    if present and len(present) < len(values):
        raise FileFormatError(
            f"{name}: frame {values.index(None)}: expected '{key}' as in other frames, got "
            "nothing; give it to all frames or to none"
        )
    return torch.tensor(present, dtype=torch.float64) if present else None


def kind_of(value: object) -> str:
    """What a JSON value is, in words."""
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "an object"
    return "nothing" if value is None else quoted(value)
