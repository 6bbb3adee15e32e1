"""Canonical Gaussians from latents of true videos, compared by their renders.

    video ─ vae (frozen) ─ latent ─┐
    cameras ─ Plücker maps ────────┴─ ldrm ─ Gaussians ─ render ─ losses

The deformation network is not stored in this stage.
"""

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video
from diff4splat.training.stages.loss_terms import reconstruction_terms, weighted_sum
from diff4splat.training.stages.model_stage import Terms
from diff4splat.training.stages.reconstruction_stage import ReconstructionStage
from diff4splat.training.stages.scene_prediction import RenderedScenes


class StaticStage(ReconstructionStage):
    """LDRM from clips in which nothing moves."""

    parts = ("vae", "ldrm")

    def render(self, batch: ClipBatch) -> RenderedScenes:
        """The canonical scenes at the targets."""
        return self.scenes.render_static(batch, encode_video(self.vae, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of the renders at the targets."""
        batch, rendered = self.predict(batch)
        losses, features = self.plan.recipe.losses, self.plan.features
        return weighted_sum(reconstruction_terms(rendered, batch, losses, features))
