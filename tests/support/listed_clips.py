"""Clips in memory as the source of an evaluation."""

from collections.abc import Sequence
from dataclasses import dataclass

from diff4splat.data.clip import Clip


@dataclass(frozen=True, slots=True)
class ListedClips:
    """A ``ClipSource``."""

    clips: Sequence[Clip]

    def __len__(self) -> int:
        return len(self.clips)

    def clip(self, index: int) -> Clip:
        return self.clips[index]
