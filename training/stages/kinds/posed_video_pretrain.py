"""Canonical Gaussians from images and cameras alone, before there is an autoencoder.

Latents are zero. Most of a refinement decoder reads none, so this stage can run while the
autoencoder trains. Recipes make sure that there is such a decoder and that it reads true frames.
"""

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import zero_latents
from diff4splat.training.stages.loss_terms import reconstruction_terms, weighted_sum
from diff4splat.training.stages.model_stage import Terms
from diff4splat.training.stages.reconstruction_stage import ReconstructionStage
from diff4splat.training.stages.scene_prediction import RenderedScenes


class PosedVideoPretrainStage(ReconstructionStage):
    """LDRM from posed videos without an autoencoder."""

    parts = ("ldrm",)

    def render(self, batch: ClipBatch) -> RenderedScenes:
        """The canonical scenes at the targets."""
        return self.scenes.render_static(batch, zero_latents(self.plan.model, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of the renders at the targets."""
        batch, rendered = self.predict(batch)
        losses, features = self.plan.recipe.losses, self.plan.features
        return weighted_sum(reconstruction_terms(rendered, batch, losses, features))
