"""Latents of a true video to a scene, judged by its renders: static stages, then motion.

    video ─ vae (frozen) ─ latent ─┐
    cameras ─ Plücker maps ────────┴─ ldrm ─ Gaussians ─┬───────────────── render ─ losses
                                     └ tokens, time ─ deformation ─ moved ┘

In a static stage the deformation network is not held, let alone executed.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.measures import reconstruction_measures
from diff4splat.training.stages.model_stage import ModelStage, network_rays
from diff4splat.training.stages.panels import reconstruction_panel
from diff4splat.training.stages.prediction import (
    Rendered,
    canonical_scenes,
    moving_pictures,
    still_pictures,
    track_offsets,
    with_depth,
)
from diff4splat.training.stages.terms import motion_term, rendering_terms


class StaticStage(ModelStage):
    """Canonical Gaussians from clips in which nothing moves."""

    parts = ("vae", "ldrm")

    def forward(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """Rendering losses at the targets."""
        batch = self.given(batch)
        rendered = self.render(batch, self.encode(batch))
        return rendering_terms(rendered, batch, self.plan.recipe.losses, self.plan.features)

    def given(self, batch: ClipBatch) -> ClipBatch:
        """Whole videos, or in some steps their first pictures: drafts are made from one."""
        draw = torch.rand((), generator=self.draw_for_step(batch, "single"))
        alone = self.training and bool(draw < self.plan.recipe.single_share)
        return batch.first_picture() if alone else batch

    def render(self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]) -> Rendered:
        """Pictures of the canonical scenes at the targets."""
        sight = self.sight(batch, latent)
        maps = self.ldrm(latent, network_rays(batch), sight, moving=False)
        with torch.autocast(latent.device.type, enabled=False):
            scenes = canonical_scenes(maps, batch, self.plan.model, sight)
            return with_depth(still_pictures(scenes, batch), maps, self.plan.model)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """PSNR and depth correlation at the targets, and displacement error where there is one."""
        batch = self.given(batch)
        return reconstruction_measures(self.render(batch, self.encode(batch)), batch)

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Input, truth, prediction, both depths, motion."""
        batch = self.given(batch)
        return reconstruction_panel(self.render(batch, self.encode(batch)), batch)


class SightStage(StaticStage):
    """The same from pictures and cameras alone, before there is an autoencoder: latents are 0.

    Most of a detail decoder needs none, so this stage can run while the autoencoder learns. Recipes
    make sure that there is such a decoder and that it sees true pictures.
    """

    parts = ("ldrm",)

    def encode(self, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
        """Zeros in the shape of the latents."""
        model, size_px = self.plan.model, batch.cameras.size_px
        grid = model.latent_grid(batch.video.shape[1], size_px)
        return torch.zeros(len(batch), model.vae.latent_channels, *grid, device=batch.video.device)


class DynamicStage(StaticStage):
    """The same with the deformation network: targets at any time, and the motion loss."""

    parts = ("vae", "ldrm", "deformation")

    def render(self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]) -> Rendered:
        """Pictures of the moved scenes at the targets, one query time after the other."""
        sight = self.sight(batch, latent)
        maps = self.ldrm(latent, network_rays(batch), sight)
        deformations = self.deformations(maps, batch)
        with torch.autocast(latent.device.type, enabled=False):
            scenes = canonical_scenes(maps, batch, self.plan.model, sight)
            rendered = moving_pictures(scenes, deformations, batch, self.plan.model)
            return with_depth(rendered, maps, self.plan.model)

    def deformations(self, maps: RawGaussianMaps, batch: ClipBatch) -> list[Tensor]:
        """Raw maps (b, 10, …) at every target time."""
        return list(self.deformation.at_times(maps.tokens, batch.target_time.unbind(1)))


class MotionStage(DynamicStage):
    """Deformation alone, from followed points alone: nothing is rendered to learn from.

    Most of a dynamic step is rendering and the gradient of LDRM, and displacements need neither.
    """

    def forward(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """The motion loss at the target times."""
        latent, losses = self.encode(batch), self.plan.recipe.losses
        maps = self.ldrm(latent, network_rays(batch), self.sight(batch, latent))
        offsets = track_offsets(self.deformations(maps, batch), batch, self.plan.model)
        term = motion_term(offsets, batch, losses)
        return {"motion": term, TOTAL: losses.motion * term}
