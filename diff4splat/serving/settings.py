"""Limits of a server."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerSettings:
    """Where a server works, and how much it takes on."""

    folder: Path
    """Jobs and their database; nothing else is written."""
    model: str
    """A folder of ONNX graphs or weights, or a size."""
    workers: int = 1
    """Generations at a time."""
    queue_limit: int = 32
    """Jobs that may wait; more are refused until one ends."""
    upload_bytes: int = 20_000_000
    upload_s: float = 30.0
    """How long the body of a request may take."""
    job_s: float = 300.0
    """How long a generation may take."""
    job_bytes: int = 4_000_000_000
    """Resident memory of one generation."""
    attempts: int = 3
    """Starts of one job, after which a worker that dies is the job's fault."""
    grace_s: float = 20.0
    """How long running jobs may go on when the server stops; then they wait for its return."""
    keep_jobs: int = 1_000
    """Ended jobs whose files are kept; the oldest go first."""
    infer_elements: int = 4_000_000
    """Numbers in the tensors of one inference request."""
    token: str | None = None
    """Bearer token that clients must send; None lets everyone in."""
