"""How a call of ``fit_stage`` is carried out, and what it returns."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from diff4splat.errors import ConfigError
from diff4splat.progress.phases import Phases
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.stage import Stage

Outcome = Literal["finished", "signalled", "step_limit", "time_limit"]
"""Why training returned; all but ``finished`` go on with the next call."""


def silent(text: str) -> None:
    """Take a note to nobody."""


def _nothing() -> None:
    """Do nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """One call; calls with the same folder continue each other."""

    folder: Path
    """Of this stage alone: log, checkpoints, panels, result. All processes must see it."""
    seed: int
    fingerprint: str
    """Hash of everything that decides what is learnt; a checkpoint with another is refused."""
    earlier_fingerprint: str | None = None
    """The fingerprint that an earlier release gave the same stage; accepted too."""
    trainer: TrainerSettings = field(default_factory=TrainerSettings)
    fill: Callable[[Stage], None] | None = None
    """Gives values to weights on the meta device, once they are sharded."""
    start_from: Path | None = None
    """Folder of the finished stage before this one: its weights and averages are taken over."""
    store_frozen: bool = False
    """Put frozen parts into checkpoints too."""
    stop_after_steps: int | None = None
    """Save and return after so many steps of this call."""
    stop_after_s: float | None = None
    """Save and return at the first step that ends after so many seconds of this call."""
    log_every: int = 1
    device: str | None = None
    """None takes the GPU of this process if there is one."""
    timeout_s: float = 600.0
    """How long processes wait for each other before they give up."""
    phases: Phases = field(default_factory=Phases)
    note: Callable[[str], None] = silent
    """Takes one line for people; only the first process talks."""
    begin: Callable[[], None] = _nothing
    """Called by the first process once folder and settings are known to fit, before any step."""

    def __post_init__(self) -> None:
        steps = 1 if self.stop_after_steps is None else self.stop_after_steps
        counts = (steps, self.log_every, self.timeout_s)
        if min(counts) <= 0 or not (self.stop_after_s or 0) >= 0:
            raise ConfigError(
                "run: expected stop_after_steps, log_every and timeout_s above 0, got "
                f"{self.stop_after_steps}, {self.log_every} and {self.timeout_s}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class StageResult:
    """The state of a stage."""

    stage: str
    outcome: Outcome
    step: int
    """Steps done, over all calls."""
    measures: Mapping[str, float]
    """Means of the last evaluation."""
    checkpoint: Path
    """Folder of the newest checkpoint."""
