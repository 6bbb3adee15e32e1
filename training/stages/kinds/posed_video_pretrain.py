"""Canonical Gaussians from images and cameras alone, before there is an autoencoder.

Latents are zero. Most of a refinement decoder reads none, so this stage can run while the
autoencoder trains. Recipes make sure that there is such a decoder and that it reads true frames.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.factory import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import zero_latents
from diff4splat.training.stages.input_selection import InputSelection
from diff4splat.training.stages.loss_terms import reconstruction_terms, weighted_sum
from diff4splat.training.stages.metrics import reconstruction_metrics
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import reconstruction_preview
from diff4splat.training.stages.scene_prediction import RenderedScenes, ScenePredictor


class PosedVideoPretrainStage(ModelStage):
    """LDRM from posed videos without an autoencoder."""

    parts = ("ldrm",)

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.inputs = InputSelection(
            random=self.random, single_image_probability=plan.recipe.single_image_probability
        )
        self.scenes = ScenePredictor(networks=networks, plan=plan)

    def predict(self, batch: ClipBatch) -> tuple[ClipBatch, RenderedScenes]:
        """The selected input, and the canonical scenes at its targets."""
        batch = self.inputs.select(batch, self.training)
        return batch, self.scenes.render_static(batch, zero_latents(self.plan.model, batch))

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
