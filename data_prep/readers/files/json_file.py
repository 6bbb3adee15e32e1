"""JSON files of other programs."""

import json
from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import require_file
from diff4splat.paths.formats.json_fields import kind_of

MAX_BYTES = 256 * 2**20


def read_object(file: Path) -> dict[str, object]:
    """The top-level object of a JSON file.

    Raises:
        FileFormatError: missing, huge, not JSON, or JSON of another kind.
    """
    require_file(file, "a JSON file")
    if file.stat().st_size > MAX_BYTES:
        raise FileFormatError(
            f"{file}: expected at most {MAX_BYTES // 2**20} MiB of JSON, got more; wrong file?"
        )
    try:
        root = json.loads(file.read_bytes())
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{file}: line {error.lineno}: expected JSON, but {error.msg}; repair the file"
        ) from None
    except (ValueError, RecursionError):
        raise FileFormatError(f"{file}: expected JSON, got other data; copy it again") from None
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
