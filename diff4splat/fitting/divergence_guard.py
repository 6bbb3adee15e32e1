"""The last state that was good, and when to go back to it.

A loss that is not finite costs its step. Many in a row, or a loss that stays far above what it was,
is a fit that diverges: it ends, and the last good state is what remains.
"""

import math
from collections import deque
from dataclasses import dataclass

from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import DivergenceError
from diff4splat.fitting.model import SceneModel

MOST_SKIPS = 10
"""Steps in a row without a finite loss."""
WINDOW = 200
FAR_ABOVE = 4.0
"""A window's median over the best median so far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """All numbers of a model at a step."""

    step: int
    tensors: dict[str, Tensor]
    moves: Bool[Tensor, " n"]


class Guard:
    """Watches the loss of a stage."""

    def __init__(self, model: SceneModel, every: int = 100) -> None:
        self._every, self._skips = every, 0
        self._recent: deque[float] = deque(maxlen=WINDOW)
        self._best = math.inf
        self.good = snapshot(model, 0)

    def accepts(self, loss: float) -> bool:
        """Whether the step may be taken.

        Raises:
            DivergenceError: too many steps were refused, or the loss has left for good.
        """
        if not math.isfinite(loss):
            self._skips += 1
            if self._skips >= MOST_SKIPS:
                raise DivergenceError(
                    f"fit: expected a finite loss, got {self._skips} steps in a row without; the "
                    f"state of step {self.good.step} is kept; lower the learning rates"
                )
            return False
        self._skips = 0
        self._recent.append(loss)
        return True

    def passed(self, model: SceneModel, step: int) -> None:
        """Note a step that was taken; now and then keep a copy.

        Raises:
            DivergenceError: the loss has left for good.
        """
        if (step + 1) % self._every:
            return
        median = sorted(self._recent)[len(self._recent) // 2] if self._recent else math.inf
        full = len(self._recent) == WINDOW
        if full and median > FAR_ABOVE * self._best:
            raise DivergenceError(
                f"fit: expected a loss near {self._best:.3g}, got {median:.3g} over {WINDOW} "
                f"steps; the state of step {self.good.step} is kept; lower the learning rates"
            )
        if full:
            self._best = min(self._best, median)
        if median <= 2 * self._best or not math.isfinite(self._best):
            self.good = snapshot(model, step + 1)


def snapshot(model: SceneModel, step: int) -> Snapshot:
    """A copy that later steps do not touch."""
    tensors = {name: value.clone() for name, value in model.table.tensors().items()}
    return Snapshot(step=step, tensors=tensors, moves=model.moves.clone())


def restore(model: SceneModel, kept: Snapshot) -> None:
    """Put a copy back."""
    model.table.load(kept.tensors)
    model.moves = kept.moves.clone()
