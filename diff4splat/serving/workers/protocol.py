"""Lines of JSON between the server and a worker.

    server → worker, on standard input     one task, then end of file when the server dies
    worker → server, on standard output    {"ready": true}, {"phase", "done", "steps"}…,
                                           {"ended": true} or {"refused": message}

A worker that ends without the last line has died.
"""

import json
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One generation, with paths that the server chose."""

    photo: str
    out: str
    preview: str
    """A PNG that appears as soon as there is a scene."""
    model: str
    options: dict[str, Any]

    def to_line(self) -> bytes:
        """As the worker reads it."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_line(cls, line: str) -> "Task":
        """As the server wrote it."""
        return cls(**json.loads(line))


def message(**values: object) -> str:
    """One line of a worker."""
    return json.dumps(values) + "\n"


def parse_message(line: bytes) -> dict[str, Any]:
    """What a worker says; anything else it prints is nothing."""
    try:
        found = json.loads(line)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
