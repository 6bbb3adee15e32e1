"""The head of an HTTP response to a request for a file or the rest of it."""

import re
from dataclasses import dataclass
from email.message import Message

from diff4splat.errors import InputError

OK, PARTIAL = 200, 206


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What follows."""

    start: int
    """First byte of the file that is sent."""
    total: int | None
    """Length of the whole file; None where the server does not say."""
    validator: str
    """Strong ETag or date of the last change, for the next request; empty without one."""


def parse_response(address: str, status: int, headers: Message, start: int) -> Response:
    """Read the head of a response to a request from byte ``start`` on.

    Raises:
        InputError: another range than was asked for, another status, or a page instead of a file.
    """
    if headers.get("Content-Type", "").startswith("text/html"):
        raise InputError(
            f"{address}: expected a file, got a web page; a proxy or a log-in may stand in between"
        )
    tag = headers.get("ETag", "")
    validator = tag if tag and not tag.startswith("W/") else headers.get("Last-Modified", "")
    if status == OK:
        return Response(start=0, total=_number(headers.get("Content-Length")), validator=validator)
    if status != PARTIAL or not start:
        raise InputError(f"{address}: expected the file, got HTTP status {status}")
    match = re.fullmatch(r"bytes (\d+)-(\d+)/(\d+|\*)", headers.get("Content-Range", ""))
    if match is None or int(match[1]) != start:
        raise InputError(
            f"{address}: expected bytes from {start:,} on, got the range "
            f"{headers.get('Content-Range', 'none')!r}; remove the .part file and try again"
        )
    return Response(start=start, total=_number(match[3]), validator=validator)


def _number(text: str | None) -> int | None:
    return int(text) if text is not None and text.isascii() and text.isdigit() else None
