"""Samples by global index: which source, which clip, which frames; the same on any machine.

The trainer asks for indices; everything else follows from them, the seed and the stage's name.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import torch

from diff4splat.data.clip import Clip
from diff4splat.training.batches.clip_batch import ClipBatch, collate
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.batches.sources import EndlessClips, open_mixture
from diff4splat.training.recipe.data import SourceSettings
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import SampleKey


class ClipSamples:
    """A mixture of sources as samples of one shape."""

    def __init__(
        self, recipe: StageRecipe, seed: int, sources: Sequence[EndlessClips | None]
    ) -> None:
        self.recipe = recipe
        self.seed = seed
        self.sources = tuple(sources)

    @classmethod
    def open(cls, recipe: StageRecipe, seed: int) -> "ClipSamples":
        """The sources that the recipe names.

        Raises:
            InputError, FileFormatError: a folder is not one of shards.
        """
        opened, data = open_mixture(recipe.data, seed)
        return cls(replace(recipe, data=data), seed, opened)

    def __getitem__(self, sample_index: int) -> ClipBatch:
        """A batch of one.

        Raises:
            Diff4SplatError: the clip cannot be used; another index may do.
        """
        number = self._source(sample_index)
        key = SampleKey(self.seed, self.recipe.name, sample_index, "sample")
        clip = self.sources[number].clip(sample_index)
        settings = self.recipe.data.sources[number]
        origin = Origin(key=key, source=self._name(number), settings=settings)
        return make_sample(clip, self.recipe.data, origin)

    def clip(self, sample_index: int) -> tuple[Clip, str, SourceSettings]:
        """The clip of a sample as its source has it, and the source's name and settings.

        Raises:
            Diff4SplatError: the clip cannot be used; another index may do.
        """
        number = self._source(sample_index)
        settings = self.recipe.data.sources[number]
        return self.sources[number].clip(sample_index), self._name(number), settings

    def collate(self, samples: list[ClipBatch]) -> ClipBatch:
        """Samples as one batch."""
        return collate(samples)

    def _name(self, number: int) -> str:
        """For the log: losses are logged per source."""
        source = self.recipe.data.sources[number]
        return f"{number} {source.folder or f'{source.kind} {source.split}'}"

    def _source(self, sample_index: int) -> int:
        """Drawn in proportion to the weights."""
        weights = torch.tensor([source.weight for source in self.recipe.data.sources])
        key = SampleKey(self.seed, self.recipe.name, sample_index, "source")
        return int(torch.multinomial(weights.double(), 1, generator=key.generator()))


class SamplesOfClips:
    """Samples of another shape, from the clips that a recipe names."""

    def __init__(self, clips: ClipSamples) -> None:
        self.clips, self.recipe = clips, clips.recipe

    @classmethod
    def open(cls, recipe: StageRecipe, seed: int) -> Self:
        """The sources that the recipe names.

        Raises:
            InputError, FileFormatError: a folder is not one of shards.
        """
        return cls(ClipSamples.open(recipe, seed))
