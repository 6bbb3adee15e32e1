"""What a fit says while it runs: a bar, one line now and then, and one JSON line per judgement."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

LOG = "log.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One line of the log."""

    stage: str
    step: int
    loss: float
    gaussians: int
    moving: int
    seconds: float
    held_out_psnr_db: float | None
    """Over a few held-out frames; None where nothing is held out."""

    def __str__(self) -> str:
        quality = self.held_out_psnr_db
        judged = "" if quality is None else f", {quality:.2f} dB held out"
        return (
            f"{self.stage} {self.step:,}: loss {self.loss:.4f}{judged}, {self.gaussians:,} "
            f"Gaussians, {self.moving:,} moving, {self.seconds:.0f} s"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """Appends to the log and tells people."""

    folder: Path
    note: Callable[[str], None]

    def record(self, reading: Reading) -> None:
        """One judgement."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / LOG).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(reading)) + "\n")
        self.note(str(reading))

    def readings(self) -> list[Reading]:
        """All lines so far, those of earlier calls too; a half-written last line is left out."""
        file = self.folder / LOG
        if not file.exists():
            return []
        found = []
        for line in file.read_text(encoding="utf-8").splitlines():
            try:
                found.append(Reading(**json.loads(line)))
            except (ValueError, TypeError):
                continue
        return found

    def start_over(self) -> None:
        """Forget what an earlier fit wrote."""
        (self.folder / LOG).unlink(missing_ok=True)
