"""Detects divergence and keeps the last good state of a stage.

A step without a finite loss is skipped. A fit diverges if many steps in a row are skipped, or if
the loss stays far above its best value. The guard then raises, and the last good state remains.
"""

import math
from collections import deque
from dataclasses import dataclass

from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import DivergenceError
from diff4splat.fitting.model.scene_model import SceneModel

MAX_SKIPPED_STEPS = 10
"""Consecutive steps without a finite loss."""
WINDOW_STEPS = 200
DIVERGENCE_RATIO = 4.0
"""Median loss of a window divided by the best median so far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A copy of all parameters at one step."""

    step: int
    tensors: dict[str, Tensor]
    moving_mask: Bool[Tensor, " n"]


class DivergenceGuard:
    """Monitors the loss of a stage."""

    def __init__(self, model: SceneModel, every: int = 100) -> None:
        self._every, self._skipped = every, 0
        self._recent: deque[float] = deque(maxlen=WINDOW_STEPS)
        self._best = math.inf
        self.last_good = take_snapshot(model, 0)

    def accepts(self, loss: float) -> bool:
        """Whether the optimiser may take the step with this loss.

        Raises:
            DivergenceError: too many consecutive steps had no finite loss.
        """
        if not math.isfinite(loss):
            self._skipped += 1
            if self._skipped >= MAX_SKIPPED_STEPS:
                raise DivergenceError(
                    f"fit: expected a finite loss, got {self._skipped} steps in a row without; the "
                    f"state of step {self.last_good.step} is kept; lower the learning rates"
                )
            return False
        self._skipped = 0
        self._recent.append(loss)
        return True

    def after_step(self, model: SceneModel, step: int) -> None:
        """Register an accepted step; copy the model at regular intervals.

        Raises:
            DivergenceError: the median loss rose far above its best value.
        """
        if (step + 1) % self._every:
            return
        median = sorted(self._recent)[len(self._recent) // 2] if self._recent else math.inf
        full = len(self._recent) == WINDOW_STEPS
        if full and median > DIVERGENCE_RATIO * self._best:
            raise DivergenceError(
                f"fit: expected a loss near {self._best:.3g}, got {median:.3g} over {WINDOW_STEPS} "
                f"steps; the state of step {self.last_good.step} is kept; lower the learning rates"
            )
        if full:
            self._best = min(self._best, median)
        if median <= 2 * self._best or not math.isfinite(self._best):
            self.last_good = take_snapshot(model, step + 1)


def take_snapshot(model: SceneModel, step: int) -> Snapshot:
    """Copy all parameters, independent of later steps."""
    tensors = {name: value.clone() for name, value in model.table.tensors().items()}
    return Snapshot(step=step, tensors=tensors, moving_mask=model.moving_mask.clone())


def restore_snapshot(model: SceneModel, snapshot: Snapshot) -> None:
    """Overwrite the parameters of ``model`` with a snapshot."""
    model.table.load(snapshot.tensors)
    model.moving_mask = snapshot.moving_mask.clone()
