"""One job and its states.

    queued ─ running ─┬─ done
       ▲        │     ├─ failed
       └────────┘     └─ cancelled      also from queued

A running job goes back to the queue when its worker dies or the server stops.
"""

import re
import secrets
from dataclasses import dataclass, field
from typing import Any, Literal

State = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED: tuple[State, ...] = ("done", "failed", "cancelled")
_IDENTIFIER = re.compile(r"[0-9a-f]{32}")


@dataclass(slots=True, kw_only=True)
class Job:
    """What the database keeps, and the progress that it does not."""

    identifier: str
    options: dict[str, Any]
    state: State = "queued"
    attempts: int = 0
    """How often a worker took it up."""
    error: str = ""
    created_s: float = 0.0
    """Seconds since 1970, as for the next two."""
    started_s: float = 0.0
    ended_s: float = 0.0
    phase: str = ""
    """What the worker is doing."""
    progress: tuple[int, int] = (0, 0)
    """Steps done and steps of this phase."""
    results: tuple[str, ...] = field(default=())
    """Files that a client may fetch."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will happen."""
        return self.state in ENDED


def new_identifier() -> str:
    """A name that cannot be guessed: whoever knows it may read and cancel the job."""
    return secrets.token_hex(16)


def is_identifier(text: str) -> bool:
    """Whether it has the form of one; anything else never comes near a path."""
    return _IDENTIFIER.fullmatch(text) is not None
