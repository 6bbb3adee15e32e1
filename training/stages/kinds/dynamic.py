"""Deformed Gaussians from latents of true videos, compared by renders at any time.

video ─ vae (frozen) ─ latent ─┐
cameras ─ Plücker maps ────────┴─ ldrm ─ Gaussians ──────────────┬─ render ─ losses
└ tokens, time ─ deformation ───┘
"""

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video
from diff4splat.training.stages.loss_terms import motion_term, reconstruction_terms, weighted_sum
from diff4splat.training.stages.model_stage import Terms
from diff4splat.training.stages.reconstruction_stage import ReconstructionStage
from diff4splat.training.stages.scene_prediction import RenderedScenes


class DynamicStage(ReconstructionStage):
    """LDRM and deformation from moving clips and tracked points."""

    parts = ("vae", "ldrm", "deformation")

    def render(self, batch: ClipBatch) -> RenderedScenes:
        """The deformed scenes at the targets."""
        return self.scenes.render_dynamic(batch, encode_video(self.vae, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms of the renders and of the displacements at the targets."""
        batch, rendered = self.predict(batch)
        losses, features = self.plan.recipe.losses, self.plan.features
        terms = reconstruction_terms(rendered, batch, losses.reconstruction, features)
        return weighted_sum([*terms, motion_term(rendered.offsets, batch, losses.motion)])
