"""JSON text of any file, decoded within limits that no honest file reaches.

Python's decoder stops at deep nesting and long whole numbers with errors of its own, and passes
whole numbers on that no float can hold. Here nesting is limited, and whole numbers of hundreds of
digits become infinity, as in most other programs: checks of numbers then see them.
"""

import json
import re
from itertools import accumulate

from diff4splat.errors import FileFormatError

MAX_DEPTH = 64
_MAX_DIGITS = 300
"""Every such number fits float64."""
_TOKEN = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"|[\[\]{}]', re.DOTALL)
_STEP = {"[": 1, "{": 1, "]": -1, "}": -1}


def decode_json(content: str | bytes) -> object:
    """The value of a JSON text; bytes are UTF-8.

    Raises:
        FileFormatError: not JSON, or nested too deeply; without the name of the file.
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError("expected JSON in UTF-8, got other data; copy it again") from None
    _require_depth(text)
    try:
        return json.loads(text, parse_int=_whole_number)
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"line {error.lineno}: expected JSON, but {error.msg}; repair the file"
        ) from None


def decode_object(content: str | bytes) -> dict[str, object]:
    """As ``decode_json``; anything but an object is refused."""
    root = decode_json(content)
    if not isinstance(root, dict):
        got = f"a list of {len(root)}" if isinstance(root, list) else "a single value"
        raise FileFormatError(f"expected a JSON object, got {got}; check the path")
    return root


def _require_depth(text: str) -> None:
    if text.count("[") + text.count("{") <= MAX_DEPTH:
        return
    steps = (_STEP.get(match[0], 0) for match in _TOKEN.finditer(text))
    if max(accumulate(steps), default=0) > MAX_DEPTH:
        raise FileFormatError(
            f"expected JSON of at most {MAX_DEPTH} levels, got deeper nesting; repair the file"
        )


def _whole_number(digits: str) -> int | float:
    return int(digits) if len(digits) <= _MAX_DIGITS else float(digits)
