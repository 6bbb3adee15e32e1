"""Progress log of a fit: one JSON line and one printed line per evaluation."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from diff4splat.io.require_file import require_writable

LOG_FILE = "log.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """One line of the log."""

    stage: str
    step: int
    loss: float
    gaussians: int
    moving: int
    seconds: float
    held_out_psnr_db: float | None
    """Mean over a few held-out frames; None without held-out frames."""

    def __str__(self) -> str:
        psnr_db = self.held_out_psnr_db
        quality = "" if psnr_db is None else f", {psnr_db:.2f} dB held out"
        return (
            f"{self.stage} {self.step:,}: loss {self.loss:.4f}{quality}, {self.gaussians:,} "
            f"Gaussians, {self.moving:,} moving, {self.seconds:.0f} s"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FitLogger:
    """Appends entries to the log file and prints them."""

    folder: Path
    note: Callable[[str], None]

    def record(self, entry: LogEntry) -> None:
        """Write one entry.

        Raises:
            OutputError: a pipe or a device stands in the place of the log.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        require_writable(self.folder / LOG_FILE)
        with (self.folder / LOG_FILE).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(entry)) + "\n")
        self.note(str(entry))

    def clear(self) -> None:
        """Delete the log of an earlier fit."""
        (self.folder / LOG_FILE).unlink(missing_ok=True)
