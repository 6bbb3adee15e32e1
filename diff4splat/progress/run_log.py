"""Log of a run: seconds per phase, networks that ran, and skipped work."""

from collections.abc import Collection
from dataclasses import dataclass, field

from diff4splat.progress.phases import Phases
from diff4splat.progress.skipped import SkippedWork, SkippedWorkList


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLog:
    """Passed through a command; prints nothing unless its phases draw progress bars."""

    phases: Phases = field(default_factory=Phases)
    skipped: SkippedWorkList = field(default_factory=SkippedWorkList)
    networks: list[str] = field(default_factory=list)
    """Names of the networks that ran, in order."""
    depth: dict[str, object] = field(default_factory=dict)
    """Where the depth came from; empty where no scene is generated."""

    def record_skipped(
        self, what: str, why: str, saved: str, error: float | None = 0.0, error_unit: str = ""
    ) -> None:
        """Record work that this run did not need."""
        self.skipped.add(
            SkippedWork(what=what, why=why, saved=saved, error=error, error_unit=error_unit)
        )

    def record_unused(self, networks: Collection[str], why: str) -> None:
        """Record networks that were planned, but had nothing to do."""
        for network in [name for name in self.networks if name in networks]:
            self.networks.remove(network)
            self.record_skipped(network, why, "its run")
