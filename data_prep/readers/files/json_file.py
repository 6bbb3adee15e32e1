"""JSON files of other programs."""

from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import MAX_TEXT_BYTES, read_bytes
from diff4splat.paths.formats.json_fields import kind_of
from diff4splat.paths.formats.json_text import decode_json


def read_object(file: Path) -> dict[str, object]:
    """The top-level object of a JSON file.

    Raises:
        FileFormatError: missing, huge, not JSON, or JSON of another kind.
    """
    content = read_bytes(file, "a JSON file", max_bytes=MAX_TEXT_BYTES)
    try:
        root = decode_json(content)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from None
    if not isinstance(root, dict):
        raise FileFormatError(
            f"{file}: expected a JSON object, got {kind_of(root)}; check the path"
        )
    return root


def texts(root: dict[str, object], key: str, where: str) -> list[str]:
    """The list of texts under ``key``; numbers are taken as text, nothing as an empty list.

    Raises:
        FileFormatError: another kind.
    """
    values = root.get(key)
    if values is None:
        return []
    if not isinstance(values, list) or not all(isinstance(value, str | int) for value in values):
        raise FileFormatError(
            f"{where}: '{key}': expected a list of names, got {kind_of(values)}; repair the file"
        )
    return [str(value) for value in values]
