"""Which samples a step takes: a function of the step, without state.

Step k of a run with global batch G takes indices ``first + k·G + position``, position 0 to G−1.
Position ``(a·R + r)·B + i`` belongs to accumulation a, rank r of R and element i of a micro batch
of B, so any number of processes covers the same samples of a step. ``first`` grows only when a
window of data is skipped after a roll-back.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from diff4splat.errors import ConfigError
from diff4splat.training.recipe.stage import StageRecipe


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchPlan:
    """How a global batch is dealt out."""

    global_batch: int
    micro_batch: int
    ranks: int
    rank: int

    def __post_init__(self) -> None:
        share = self.micro_batch * self.ranks
        if share < 1 or self.global_batch < 1 or self.global_batch % share:
            raise ConfigError(
                f"global batch: expected a multiple of {self.ranks} processes times micro batch "
                f"{self.micro_batch}, got {self.global_batch}; change one of them"
            )

    @property
    def accumulation(self) -> int:
        """Micro batches per step and process."""
        return self.global_batch // (self.micro_batch * self.ranks)

    def micro_batches(self, step: int, first: int = 0) -> Iterator[list[int]]:
        """Sample indices of this rank at a step, one list per micro batch."""
        for turn in range(self.accumulation):
            start = first + step * self.global_batch
            start += (turn * self.ranks + self.rank) * self.micro_batch
            yield list(range(start, start + self.micro_batch))


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRange:
    """Micro batches of many steps, one after another, as a loader's batch sampler."""

    plan: BatchPlan
    begin: int
    end: int
    first: int

    def __len__(self) -> int:
        return (self.end - self.begin) * self.plan.accumulation

    def __iter__(self) -> Iterator[list[int]]:
        for step in range(self.begin, self.end):
            yield from self.plan.micro_batches(step, self.first)


def plan_batches(recipe: StageRecipe, ranks: int, rank: int) -> BatchPlan:
    """The plan of a recipe on so many processes."""
    return BatchPlan(
        global_batch=recipe.global_batch, micro_batch=recipe.micro_batch, ranks=ranks, rank=rank
    )
