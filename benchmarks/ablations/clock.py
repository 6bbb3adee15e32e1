"""Processor seconds of training steps, in the log that the trainer keeps of a stage.

    {"event": "cpu", "step": …, "seconds": …}

The machine may be shared: wall time would count what others compute. A step that was repeated
after a crash counts once, with its later row.
"""

import json
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff4splat.progress.phases import Advance, Phases
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.trainer.logs.run_files import LOG_FILE, EventLog

EVENT = "cpu"
NOTES = 10
"""Lines for people over a whole stage."""


@dataclass(slots=True, kw_only=True)
class StepClock(Phases):
    """Clocks the steps of one stage; all other phases pass unseen."""

    folder: Path
    """Of the stage."""
    stage: StageRecipe
    note: Callable[[str], None]
    now_s: Callable[[], float] = time.process_time

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """One row for every step of the stage; ``steps`` are those that remain of it."""
        if name != self.stage.name:
            yield lambda: None
            return
        log, step, began_s = EventLog(self.folder), self.stage.steps - steps, self.now_s()

        def advance() -> None:
            nonlocal step, began_s
            ended_s = self.now_s()
            log.write(EVENT, step, {"seconds": ended_s - began_s})
            step, began_s = step + 1, ended_s
            if step % max(1, self.stage.steps // NOTES) == 0:
                self.note(f"{self.folder}: step {step} of {self.stage.steps}")

        yield advance


def step_seconds(folder: Path) -> list[float]:
    """Seconds of every step in a stage's folder, in order."""
    lines = (folder / LOG_FILE).read_text(encoding="utf-8").splitlines()
    rows = [row for line in lines if (row := _row(line)).get("event") == EVENT]
    return [seconds for _, seconds in sorted({row["step"]: row["seconds"] for row in rows}.items())]


def typical_s(seconds: list[float], warm_up: int) -> float:
    """Median over the steps behind the warm-up."""
    return statistics.median(seconds[warm_up:])


def steps_for(own_step_s: float, budget: list[tuple[int, float]]) -> int:
    """Steps that take as long as others: (steps, seconds each) per stage; at least one."""
    return max(1, round(sum(steps * step_s for steps, step_s in budget) / own_step_s))


def _row(line: str) -> dict[str, Any]:
    """A row of the log; nothing where a crash left half of one."""
    try:
        return json.loads(line)
    except json.JSONDecodeError:
        return {}
