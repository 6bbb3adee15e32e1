"""Depth priors of known distance."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor


class DistancePrior:
    """With one encoder, and without uncertainty; a test gives ``distance``."""

    def distance(self, image: Tensor) -> Tensor:
        raise NotImplementedError

    def __call__(self, image: Tensor) -> Tensor:
        return self.distance(image)

    def predict_distance_and_uncertainty(self, image: Tensor) -> tuple[Tensor, Tensor | None]:
        return self.distance(image), None


@dataclass(frozen=True)
class DistanceOf(DistancePrior):
    """By a function."""

    function: Callable[[Tensor], Tensor]

    def distance(self, image: Tensor) -> Tensor:
        return self.function(image)


@dataclass(frozen=True)
class TwoEncoders(DistancePrior):
    """By two functions, and the log uncertainty by a third."""

    first: Callable[[Tensor], Tensor]
    second: Callable[[Tensor], Tensor]
    log_uncertainty: Callable[[Tensor], Tensor] | None = None

    def predict_distance_and_uncertainty(self, image: Tensor) -> tuple[Tensor, Tensor | None]:
        unsure = None if self.log_uncertainty is None else self.log_uncertainty(image)
        return torch.cat([self.first(image), self.second(image)], 1), unsure
