"""What a run writes and says while it goes: log rows, curves, panels, notes. First process only."""

from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxtyping import Float
from torch import Tensor

from diff4splat.io.photos.images import write_png
from diff4splat.training.stage import TOTAL
from diff4splat.training.trainer.logs.run_files import PANELS, TENSORBOARD, EventLog, finite
from diff4splat.training.trainer.logs.tensorboard_logger import TensorboardLogger
from diff4splat.training.trainer.loop.nan_policy import SNAPSHOT_FILE, write_snapshot
from diff4splat.training.trainer.loop.step import StepReport
from diff4splat.training.trainer.settings import RunSettings

SNAPSHOT_STEPS = 50
"""Skipped steps that the snapshot remembers."""


class RunLogger:
    """Log rows go to ``log.jsonl`` and, as curves, to TensorBoard."""

    def __init__(self, run: RunSettings, first: bool) -> None:
        self._run, self._first = run, first
        self._skipped: deque[dict[str, Any]] = deque(maxlen=SNAPSHOT_STEPS)
        self._log = EventLog(run.folder) if first else None
        self._tensorboard = TensorboardLogger(run.folder / TENSORBOARD, run.note) if first else None

    @property
    def snapshot(self) -> Path:
        """Where the samples of skipped steps are listed."""
        return self._run.folder / SNAPSHOT_FILE

    def step(self, step: int, report: StepReport, values: Mapping[str, float]) -> None:
        """A step, if it is one of those to log, and every sample that was replaced."""
        for failure in report.failures:
            row = {"sample": failure.sample, "reason": failure.reason, "why": failure.message}
            self.event("replaced_sample", step, row)
        if not self._first or step % self._run.log_every:
            return
        losses = {f"loss/{name}": value for name, value in report.losses.items()}
        losses |= {f"source/{name}": value for name, value in report.source_losses.items()}
        self._log.write("step", step, losses | dict(values))
        self._tensorboard.scalars(step, finite(losses | dict(values)))

    def skip(self, step: int, report: StepReport, reason: str) -> None:
        """A step without an update, with its samples."""
        row = {"reason": reason, "bad_samples": report.bad_samples, "samples": report.samples}
        self.event("skip", step, row)
        self._skipped.append({"step": step} | row)
        if self._first:
            write_snapshot(self.snapshot, list(self._skipped))

    def spike(self, step: int, report: StepReport) -> None:
        """A loss far above its median, with its samples."""
        self.event("spike", step, {TOTAL: report.total, "samples": report.samples})

    def evaluation(
        self, step: int, measures: Mapping[str, float], panel: Float[Tensor, "h w 3"]
    ) -> None:
        """Measures as a row, the panel as a PNG, both on the board."""
        if not self._first:
            return
        self.event("evaluation", step, dict(measures))
        self._tensorboard.scalars(step, {f"evaluation/{k}": v for k, v in finite(measures).items()})
        self._tensorboard.image(step, panel)
        write_png(panel, self._run.folder / PANELS / f"step-{step:08d}.png")

    def event(self, event: str, step: int, values: Mapping[str, Any]) -> None:
        """Any other row."""
        if self._first:
            self._log.write(event, step, values)

    def note(self, text: str) -> None:
        """One line for people."""
        if self._first:
            self._run.note(text)

    def close(self) -> None:
        """End the curves."""
        if self._first:
            self._tensorboard.close()
