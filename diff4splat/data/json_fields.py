"""Values out of JSON files by key, each checked before anything uses it."""

import json
import math
import re
from pathlib import Path
from typing import Any

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_bytes
from diff4splat.paths.formats.json_text import decode_json

VERSION = 2
"""Of manifest, index and clip note alike; it changes when an old reader would go wrong."""
OLDEST_VERSION = 1
"""Without data sets, scenes, frame rates and scale; depth everywhere, tracks known everywhere."""
IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,79}")
"""No dots (webdataset ends the name of a clip at the first), no slashes, nothing to escape."""
MAX_SIDE_PX, MAX_FRAMES, MAX_VIEWS, MAX_TRACKS = 16384, 10_000, 100, 10_000_000
"""More is damage, not a wish; two digits number the views."""
_KIND_NAMES = {
    dict: "an object",
    list: "a list",
    str: "text",
    bool: "true or false",
    int: "a whole number",
}
_LARGEST_FILE = 1 << 30
"""Bytes of a manifest or an index; a million clips need a quarter."""
_FARTHEST = 1 << 48
"""Bytes; keeps sums of offsets and sizes far from any limit."""


def dumps(document: dict[str, Any]) -> str:
    """Compact JSON whose bytes depend on nothing but the values."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False) + "\n"


def load_file(file: Path, kind: str) -> dict[str, Any]:
    """The top-level object of a JSON file of the format ``kind``, in a version we know.

    Raises:
        FileFormatError: missing, not JSON, another format or a newer version.
    """
    content = read_bytes(file, f"a {kind} file", max_bytes=_LARGEST_FILE)
    try:
        return loads(content, kind)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error


def loads(content: bytes, kind: str) -> dict[str, Any]:
    """As ``load_file``, of bytes."""
    root = decode_json(content)
    if not isinstance(root, dict) or root.get("format") != kind:
        raise FileFormatError(f"expected a {kind}, got JSON of another kind; check the path")
    version = take(root, "version", int)
    if not OLDEST_VERSION <= version <= VERSION:
        raise FileFormatError(
            f"expected version {OLDEST_VERSION} to {VERSION}, got {version}; read it with the "
            "diff4splat that wrote it"
        )
    return root


def take(source: dict[str, Any], key: str, kind: type) -> Any:
    """The value under ``key``, of type ``kind``; a whole number is also within 0 and 2⁴⁸."""
    value = source.get(key)
    # bool is an int to Python, but true is not a number to anybody else.
    wrong = not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)
    if wrong or (kind is int and not 0 <= value <= _FARTHEST):
        got = "nothing" if value is None else repr(value)[:60]
        raise FileFormatError(f"'{key}': expected {_KIND_NAMES[kind]}, got {got}")
    return value


def take_count(source: dict[str, Any], key: str, least: int, most: int) -> int:
    """The whole number under ``key``, from ``least`` to ``most``."""
    value = take(source, key, int)
    if not least <= value <= most:
        raise FileFormatError(f"'{key}': expected {least} to {most}, got {value}")
    return value


def take_number(source: dict[str, Any], key: str) -> float | None:
    """The finite number under ``key``; None where there is none."""
    value = source.get(key)
    if value is None:
        return None
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value):
        raise FileFormatError(f"'{key}': expected a finite number, got {repr(value)[:60]}")
    return float(value)


def take_choice(source: dict[str, Any], key: str, known: tuple[str, ...]) -> Any:
    """The text under ``key``, one of ``known``."""
    value = take(source, key, str)
    if value not in known:
        raise FileFormatError(f"'{key}': expected one of {', '.join(known)}, got {value[:60]!r}")
    return value


def take_objects(source: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The list of objects under ``key``."""
    values = take(source, key, list)
    if not all(isinstance(value, dict) for value in values):
        raise FileFormatError(f"'{key}': expected a list of objects, got something else in it")
    return values


def take_identifier(source: dict[str, Any], key: str) -> str:
    """The name of a clip under ``key``: safe as a part of a file name."""
    value = take(source, key, str)
    if not IDENTIFIER.fullmatch(value):
        raise FileFormatError(
            f"'{key}': expected up to 80 letters, digits, '_' and '-', got {value[:60]!r}"
        )
    return value
