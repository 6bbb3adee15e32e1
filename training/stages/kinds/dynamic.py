"""Deformed Gaussians from latents of true videos, compared by renders at any time.

video ─ vae (frozen) ─ latent ─┐
cameras ─ Plücker maps ────────┴─ ldrm ─ Gaussians ──────────────┬─ render ─ losses
└ tokens, time ─ deformation ───┘
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.factory import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video
from diff4splat.training.stages.input_selection import InputSelection
from diff4splat.training.stages.loss_terms import motion_term, reconstruction_terms, weighted_sum
from diff4splat.training.stages.metrics import reconstruction_metrics
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import reconstruction_preview
from diff4splat.training.stages.scene_prediction import RenderedScenes, ScenePredictor


class DynamicStage(ModelStage):
    """LDRM and deformation from moving clips and tracked points."""

    parts = ("vae", "ldrm", "deformation")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.inputs = InputSelection(
            random=self.random, single_image_probability=plan.recipe.single_image_probability
        )
        self.scenes = ScenePredictor(networks=networks, plan=plan)

    def predict(self, batch: ClipBatch) -> tuple[ClipBatch, RenderedScenes]:
        """The selected input, and the deformed scenes at its targets."""
        batch = self.inputs.select(batch, self.training)
        return batch, self.scenes.render_dynamic(batch, encode_video(self.vae, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of the renders and of the displacements at the targets."""
        batch, rendered = self.predict(batch)
        losses, features = self.plan.recipe.losses, self.plan.features
        terms = reconstruction_terms(rendered, batch, losses.reconstruction, features)
        return weighted_sum([*terms, motion_term(rendered.offsets, batch, losses.motion)])

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """PSNR, depth correlation and displacement error at the targets."""
        batch, rendered = self.predict(batch)
        return reconstruction_metrics(rendered, batch)

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Input, truth, prediction, both depths and motion."""
        batch, rendered = self.predict(batch)
        return reconstruction_preview(rendered, batch)
