"""Short fine-tuning of all networks on latents of the video model (as Wonderland mixes them in).

True latents are noised to a random level and denoised by a few steps of the video model: they
carry its artefacts and still show the clip. The reconstruction is then compared with renders of the
truth. Denoised latents carry no gradient: rendering losses train the reconstruction, flow matching
the video model (Diff4Splat, training).
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import Networks, ldrm_start_parts
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.latents.video_latents import encode_batch
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.loss_terms import (
    combine,
    motion_term,
    reconstruction_terms,
    weighted_sum,
)
from diff4splat.training.stages.metrics import reconstruction_metrics
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import reconstruction_preview
from diff4splat.training.stages.scene_prediction import RenderedScenes, ScenePredictor
from diff4splat.training.stages.video_flow import VideoFlow, condition_parts

STEPS = 2
"""Euler steps from the random level back to 0."""
MAX_LEVEL = 0.8
"""Above this level the latent no longer shows the clip, so its frames are no fair target."""


class JointStage(ModelStage):
    """Video diffusion and reconstruction in one step."""

    parts = ("vae", "text_encoder", "dit", "ldrm", "deformation")

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """The depth prior makes the render conditions, and LDRM may start from it."""
        return tuple(dict.fromkeys((*cls.parts, *condition_parts(model), *ldrm_start_parts(model))))

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self._model = Model(config=plan.model, networks=networks)
        self.flow = VideoFlow(networks, plan, plan.recipe.losses.flow)
        self.scenes = ScenePredictor(networks=networks, plan=plan)

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of both, and their sum as ``total``; no flow where no network learns from it."""
        encoded = encode_batch(self._model, batch)
        learns = {"text_encoder", "dit"}.intersection(self.trained)
        flow = self.flow.terms(encoded, self.training) if learns else {TOTAL: 0.0}
        rendered = self._render(batch, encoded)
        losses, features = self.plan.recipe.losses, self.plan.features
        terms = reconstruction_terms(rendered, batch, losses.reconstruction, features)
        motion = motion_term(rendered.offsets, batch, losses.motion)
        return combine(flow, weighted_sum([*terms, motion]))

    @torch.no_grad()
    def regenerated(self, batch: LatentBatch) -> Float[Tensor, "b c t h w"]:
        """The clip's latents, noised and denoised again."""
        start = MAX_LEVEL * self.random.uniform(batch, "detour").to(batch.latent)
        video = self.flow.with_noise(batch, start, "detour noise")
        latent = video.latent
        for step in range(STEPS):
            at = replace(video, level=start * (1 - step / STEPS))
            velocity = self.flow.velocity_at(batch, latent, at.levels, self.training)
            moved = latent - (start / STEPS)[:, None, None, None, None] * velocity
            latent = torch.cat([video.clean[:, :, :1], moved[:, :, 1:]], 2)
        return latent

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """Velocity error, and the reconstruction of denoised latents."""
        encoded = encode_batch(self._model, batch)
        rendered = self._render(batch, encoded)
        flow = self.flow.measures(encoded, self.training)
        return {**flow, **reconstruction_metrics(rendered, batch)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """The reconstruction of denoised latents."""
        rendered = self._render(batch, encode_batch(self._model, batch))
        return reconstruction_preview(rendered, batch)

    def _render(self, batch: ClipBatch, encoded: LatentBatch) -> RenderedScenes:
        return self.scenes.render_dynamic(batch, self.regenerated(encoded))
