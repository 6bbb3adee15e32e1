"""Canonical Gaussians from latents of true videos, compared by their renders.

    video ─ vae (frozen) ─ latent ─┐
    cameras ─ Plücker maps ────────┴─ ldrm ─ Gaussians ─ render ─ losses

The deformation network is not stored in this stage.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.factory import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video
from diff4splat.training.stages.input_selection import InputSelection
from diff4splat.training.stages.loss_terms import reconstruction_terms, weighted_sum
from diff4splat.training.stages.metrics import reconstruction_metrics
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import reconstruction_preview
from diff4splat.training.stages.scene_prediction import RenderedScenes, ScenePredictor


class StaticStage(ModelStage):
    """LDRM from clips in which nothing moves."""

    parts = ("vae", "ldrm")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.inputs = InputSelection(
            random=self.random, single_image_probability=plan.recipe.single_image_probability
        )
        self.scenes = ScenePredictor(networks=networks, plan=plan)

    def predict(self, batch: ClipBatch) -> tuple[ClipBatch, RenderedScenes]:
        """The selected input, and the canonical scenes at its targets."""
        batch = self.inputs.select(batch, self.training)
        return batch, self.scenes.render_static(batch, encode_video(self.vae, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of the renders at the targets."""
        batch, rendered = self.predict(batch)
        losses, features = self.plan.recipe.losses, self.plan.features
        return weighted_sum(reconstruction_terms(rendered, batch, losses, features))

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """PSNR and depth correlation at the targets."""
        batch, rendered = self.predict(batch)
        return reconstruction_metrics(rendered, batch)

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Input, truth, prediction and both depths."""
        batch, rendered = self.predict(batch)
        return reconstruction_preview(rendered, batch)
