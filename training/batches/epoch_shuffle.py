"""Which of a limited number of clips a sample takes: shuffled anew in every epoch.

The last clips of each kind are for evaluation alone, so that it never reads what is trained on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from diff4splat.training.stage import SampleKey
from diff4splat.training.trainer.loading.samples import EVALUATION_START

VALIDATION_EVERY = 16
"""One clip in so many is for evaluation alone."""
IndicesByMotion = dict[tuple[str, bool], list[int]]
"""Positions by kind, still or moving, and by whether evaluation owns them."""


def split_by_motion(is_static: Sequence[bool], versions: int = 1) -> IndicesByMotion:
    """Positions of still and of moving clips, each with its last ones for evaluation.

    So many ``versions`` of one clip, one after another, stay together.
    """
    chosen = {}
    for kind, wanted in (("still", True), ("moving", False)):
        places = [place for place, static in enumerate(is_static) if bool(static) is wanted]
        kept = -(-len(places) // (VALIDATION_EVERY * versions)) * versions
        kept = kept if len(places) > versions else 0
        chosen[kind, False] = places[: len(places) - kept]
        # A single clip serves both: over-fitting tests want exactly that.
        chosen[kind, True] = places[len(places) - kept :] if kept else places
    return chosen


@dataclass(frozen=True, slots=True)
class ShuffledIndices:
    """Still and moving clips in a share, each shuffled on its own."""

    still_share: float
    seed: int

    def place(self, index: int, places: IndicesByMotion) -> int:
        """The position of a sample."""
        evaluates = index >= EVALUATION_START
        draw = torch.rand((), generator=SampleKey(self.seed, "kind", index, "still").generator())
        kind = "still" if bool(draw < self.still_share) else "moving"
        positions = places[kind, evaluates]
        epoch, place = divmod(index % EVALUATION_START, len(positions))
        shuffle = SampleKey(self.seed, "epoch", epoch, kind).generator()
        order = torch.randperm(len(positions), generator=shuffle)
        return positions[int(order[place])]
