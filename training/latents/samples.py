"""Samples for the video model from folders of encoded clips, held in memory."""

from dataclasses import replace
from pathlib import Path

import torch

from diff4splat.errors import ConfigError, InputError
from diff4splat.training.batches.epoch_shuffle import (
    IndicesByMotion,
    ShuffledIndices,
    split_by_motion,
)
from diff4splat.training.batches.requests.samples import RequestSamples
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.batches.shadows.samples import ShadowSamples
from diff4splat.training.latents.latent_batch import LatentBatch, collate_latents
from diff4splat.training.latents.latent_shards import LatentPack, read_packs, require_alike
from diff4splat.training.recipe.data import SourceSettings
from diff4splat.training.recipe.kinds import REQUEST_KINDS, SHADOW_KINDS
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import SampleKey


class _Source:
    """One folder."""

    def __init__(self, settings: SourceSettings, seed: int) -> None:
        self.name = settings.folder
        self.pack: LatentPack = read_packs(Path(settings.folder))
        self.places = split_by_motion(self.pack.is_static.tolist(), self.pack.versions)
        self.order = ShuffledIndices(settings.still_share, seed)
        _require_kinds(self.places, settings)

    def sample(self, index: int) -> LatentBatch:
        place = self.order.place(index, self.places)
        own, pack = slice(place, place + 1), self.pack
        return LatentBatch(
            sample_index=torch.tensor([index]),
            source=(self.name,),
            latent=pack.latent[own],
            render_latent=None if pack.render_latent is None else pack.render_latent[own],
            validity=None if pack.validity is None else pack.validity[own].float(),
            cameras=pack.cameras[own],
            captions=(pack.captions[place],),
        )


class LatentSamples:
    """A mixture of folders, by their weights."""

    def __init__(self, recipe: StageRecipe, seed: int) -> None:
        self.recipe, self.seed = recipe, seed
        self.sources = [_Source(settings, seed) for settings in recipe.data.sources]
        alike = [replace(source.pack, versions=1) for source in self.sources]
        require_alike(alike, f"stage {recipe.name}")

    def __getitem__(self, sample_index: int) -> LatentBatch:
        """A batch of one."""
        weights = torch.tensor([source.weight for source in self.recipe.data.sources])
        key = SampleKey(self.seed, self.recipe.name, sample_index, "source")
        number = int(torch.multinomial(weights.double(), 1, generator=key.generator()))
        return self.sources[number].sample(sample_index)

    def collate(self, samples: list[LatentBatch]) -> LatentBatch:
        """Samples as one batch."""
        return collate_latents(samples)


def open_samples(
    recipe: StageRecipe, seed: int
) -> ClipSamples | LatentSamples | RequestSamples | ShadowSamples:
    """What the recipe's sources hold: clips, clips that were encoded before, or images of clips.

    Raises:
        ConfigError: some sources are one and some the other.
        InputError, FileFormatError: a folder is not what its source says.
    """
    encoded = {source.kind == "latents" for source in recipe.data.sources}
    if len(encoded) > 1:
        raise ConfigError(
            f"stage {recipe.name}: expected sources that are all latents or all clips, got both; "
            "encode the clips first"
        )
    if encoded.pop():
        return LatentSamples(recipe, seed)
    if recipe.kind in SHADOW_KINDS:
        return ShadowSamples.open(recipe, seed)
    kind = RequestSamples if recipe.kind in REQUEST_KINDS else ClipSamples
    return kind.open(recipe, seed)


def _require_kinds(places: IndicesByMotion, settings: SourceSettings) -> None:
    needed = {"still": settings.still_share > 0, "moving": settings.still_share < 1}
    for kind, wanted in needed.items():
        if wanted and not places[kind, False]:
            raise InputError(
                f"{settings.folder}: expected {kind} clips for still_share "
                f"{settings.still_share:g}, got none; encode some or change still_share"
            )
