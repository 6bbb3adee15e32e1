"""What all stages share: parts of a model, trained or frozen, and draws that resume exactly.

Axes: ``b`` batch, ``f`` frames, ``h w`` pixels, ``c t h2 w2`` latents.
"""

from collections.abc import Collection
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import plucker_map
from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import Networks
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.recipe import StageRecipe
from diff4splat.training.stage import Batch, SampleKey, Stage
from diff4splat.training.trainer.samples import asked_index


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePlan:
    """What a stage is made from."""

    model: ModelConfig
    recipe: StageRecipe
    seed: int
    features: PerceptualFeatures
    """What the perceptual term compares; never asked when its weight is 0."""


class ModelStage(Stage):
    """Parts of a model as submodules; those that do not learn have no gradient and stay in eval."""

    parts: tuple[str, ...] = ()
    """Names of the parts that run in this stage; the others are not even held."""

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """Names of the parts that run with such a model."""
        del model
        return cls.parts

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__()
        self.plan = plan
        self.parts = self.needed(plan.model)
        self.trained = _require_parts(plan.recipe, self.parts)
        self.model = Model(config=plan.model, networks=networks)
        for name, part in networks.parts():
            if name in self.parts:
                self.add_module(name, part.requires_grad_(name in self.trained))
        self.train()

    def train(self, mode: bool = True) -> "ModelStage":
        """Frozen parts stay in eval."""
        super().train(mode)
        for name in self.parts:
            if name not in self.trained:
                getattr(self, name).eval()
        return self

    @torch.no_grad()
    def encode(self, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
        """Standardised latents of the input video, by the frozen autoencoder."""
        return self.vae.encode(network_video(batch)).mean

    @torch.no_grad()
    def sight(self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]) -> PosedVideo | None:
        """What the detail decoder sees: decoded pictures behind the first one, which is true.

        None where the model has no such decoder. Recipes may show the true pictures instead of
        decoding, which is about a fifth of a dynamic step.
        """
        if not self.plan.model.detail.used:
            return None
        truth = unit_rgb(batch.video).movedim(-1, 1)
        if self.plan.recipe.true_pictures:
            return PosedVideo(rgb=truth, cameras=batch.cameras)
        decoded = (self.vae.decode(latent).float() + 1) / 2
        rgb = torch.cat([truth[:, :, :1], decoded[:, :, 1:].clamp(0, 1)], 2)
        return PosedVideo(rgb=rgb, cameras=batch.cameras)

    def draw(self, batch: Batch, purpose: str) -> list[torch.Generator]:
        """One generator per sample, the same on any number of processes."""
        return [self._key(sample, purpose).generator() for sample in batch.sample_index.tolist()]

    def draw_for_step(self, batch: Batch, purpose: str) -> torch.Generator:
        """One generator for all samples of a step, on every process alike."""
        step = asked_index(int(batch.sample_index[0])) // self.plan.recipe.global_batch
        return self._key(step, purpose).generator()

    def noise(self, batch: Batch, like: Tensor, purpose: str) -> Tensor:
        """Standard normal numbers in the shape of ``like``."""
        rows = [torch.randn(like.shape[1:], generator=own) for own in self.draw(batch, purpose)]
        return torch.stack(rows).to(like)

    def _key(self, sample: int, purpose: str) -> SampleKey:
        return SampleKey(self.plan.seed, self.plan.recipe.name, sample, purpose)


def network_video(batch: ClipBatch) -> Float[Tensor, "b 3 f h w"]:
    """The input video as networks see it: channels first, in [−1, 1]."""
    return batch.video.movedim(-1, 1).float() / 127.5 - 1


def network_rays(batch: ClipBatch) -> Float[Tensor, "b 6 f h w"]:
    """Plücker maps of the input cameras, relative to the first."""
    return camera_rays(batch.cameras)


def camera_rays(cameras: Camera) -> Float[Tensor, "b 6 f h w"]:
    """The same for cameras of batch shape (b, f)."""
    # Products of rotations must not follow the networks into half precision.
    with torch.autocast(cameras.focal_px.device.type, enabled=False):
        return plucker_map(cameras).movedim(1, 2)


def shown_video(video: Float[Tensor, "b 3 f h w"]) -> Float[Tensor, "b f h w 3"]:
    """A network's video as pictures, channels last; 0 to 1 as far as the network keeps to it."""
    return (video.movedim(1, -1).float() + 1) / 2


def _require_parts(recipe: StageRecipe, parts: Collection[str]) -> tuple[str, ...]:
    unknown = [name for name in recipe.trained if name not in parts]
    if unknown or not recipe.trained:
        raise ConfigError(
            f"stage {recipe.name}: expected trained parts among {', '.join(parts)}, got "
            f"{', '.join(unknown) or 'none'}; a {recipe.kind} stage does not run others"
        )
    return recipe.trained
