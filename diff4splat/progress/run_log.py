"""What a run tells about itself: seconds per phase and what it left out."""

from dataclasses import dataclass, field

from diff4splat.progress.phases import Phases
from diff4splat.progress.skipped import SkippedWork, SkippedWorkList


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLog:
    """Handed down through a command; silent unless its phases draw."""

    phases: Phases = field(default_factory=Phases)
    skipped: SkippedWorkList = field(default_factory=SkippedWorkList)

    def record_skipped(self, what: str, why: str, saved: str, error: float = 0.0) -> None:
        """Record one thing that this run did not need."""
        self.skipped.add(SkippedWork(what=what, why=why, saved=saved, error=error))
