"""Short fine-tuning of everything on what the video model makes (Wonderland mixes such videos in).

True latents are noised to a random level and brought back by a few steps of the video model, so
that they carry its artefacts and still show the clip; the reconstruction is then judged by renders
of the truth. Generated latents carry no gradient: rendering losses train the reconstruction, flow
matching the video model (Diff4Splat, training).
"""

from collections.abc import Mapping
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.generator import NoisyVideo, VideoDiffusionStage
from diff4splat.training.stages.measures import reconstruction_measures
from diff4splat.training.stages.panels import reconstruction_panel
from diff4splat.training.stages.reconstruction import DynamicStage
from diff4splat.training.stages.terms import rendering_terms

STEPS = 2
"""Euler steps from the random level back to 0."""
DEEPEST = 0.8
"""Above this level the clip is forgotten, and its pictures no longer judge fairly."""


class JointStage(VideoDiffusionStage, DynamicStage):
    """Both halves in one step."""

    parts = ("vae", "text_encoder", "dit", "ldrm", "deformation")

    def forward(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """The terms of both stages, and their sum as ``total``; no flow where it teaches nobody."""
        encoded = self.encoded(batch)
        learns = {"text_encoder", "dit"}.intersection(self.trained)
        flow = self.flow_terms(encoded) if learns else {TOTAL: 0.0}
        rendered = self.render(batch, self.regenerated(encoded))
        scene = rendering_terms(rendered, batch, self.plan.recipe.losses, self.plan.features)
        return {**flow, **scene, TOTAL: flow[TOTAL] + scene[TOTAL]}

    @torch.no_grad()
    def regenerated(self, batch: LatentBatch) -> Float[Tensor, "b c t h w"]:
        """The clip's latents after a detour through noise."""
        clean = self.clean(batch)
        draws = [torch.rand(1, generator=own) for own in self.draw(batch, "detour")]
        start = DEEPEST * torch.cat(draws).to(clean)
        video = NoisyVideo(clean=clean, noise=self.noise(batch, clean, "detour noise"), level=start)
        latent = video.latent
        for step in range(STEPS):
            at = replace(video, level=start * (1 - step / STEPS))
            velocity = self.velocity_at(batch, latent, at.levels)
            moved = latent - (start / STEPS)[:, None, None, None, None] * velocity
            latent = torch.cat([clean[:, :, :1], moved[:, :, 1:]], 2)
        return self.latents(latent)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """Velocity error, and the reconstruction of regenerated latents."""
        encoded = self.encoded(batch)
        rendered = self.render(batch, self.regenerated(encoded))
        return {**self.flow_measures(encoded), **reconstruction_measures(rendered, batch)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """The reconstruction of regenerated latents."""
        latent = self.regenerated(self.encoded(batch))
        return reconstruction_panel(self.render(batch, latent), batch)
