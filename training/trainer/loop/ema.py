"""Exponential moving averages of the weights: float32, sharded as the weights are.

average ← decay·average + (1 − decay)·weight after every real optimiser step, with
decay = min(cap, 1 − (1 + n)^−0.75) at the n-th update from 0 (MoVieS; 0 at first, so an average
begins as the weights). Each part counts its own updates: a part that is new in a stage warms up
while the others go on.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.training.trainer.loop.optim import local, part_of


def warmed_decay(updates: int, cap: float) -> float:
    """Decay at an update, counted from 0."""
    return min(cap, 1 - (1 + updates) ** -0.75)


class WeightAverages:
    """Averages of named weights."""

    def __init__(self, parameters: Mapping[str, Tensor], cap: float) -> None:
        if not 0 <= cap < 1:
            raise ConfigError(f"ema_decay: expected at least 0 and below 1, got {cap}")
        self._parameters, self._cap = parameters, cap
        self.averages = {name: value.detach().clone() for name, value in parameters.items()}
        self.updates = {part_of(name): 0 for name in parameters}
        """Updates so far, per part."""

    @torch.no_grad()
    def update(self) -> None:
        """Move the averages towards the weights."""
        for name, average in self.averages.items():
            decay = warmed_decay(self.updates[part_of(name)], self._cap)
            local(average).lerp_(local(self._parameters[name].detach()), 1 - decay)
        for part in self.updates:
            self.updates[part] += 1

    def restart(self, parts: set[str]) -> None:
        """Begin again at the present weights of some parts."""
        for name, average in self.averages.items():
            if part_of(name) in parts:
                local(average).copy_(local(self._parameters[name].detach()))
        self.updates |= dict.fromkeys(parts & set(self.updates), 0)

    @contextmanager
    def swapped(self) -> Iterator[None]:
        """The networks hold the averages inside the block, and exactly their weights after it."""
        self._swap()
        try:
            yield
        finally:
            self._swap()

    @torch.no_grad()
    def _swap(self) -> None:
        for name, average in self.averages.items():
            mine, theirs = local(average), local(self._parameters[name].detach())
            kept = theirs.clone()
            theirs.copy_(mine)
            mine.copy_(kept)
