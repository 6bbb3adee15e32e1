"""Deformation from the displacement of tracked points, without rendering.

Most of a dynamic step is rendering and the gradient of LDRM, and displacements need neither.
"""

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video
from diff4splat.training.stages.loss_terms import motion_term, weighted_sum
from diff4splat.training.stages.model_stage import Terms
from diff4splat.training.stages.reconstruction_stage import ReconstructionStage
from diff4splat.training.stages.scene_prediction import RenderedScenes


class MotionStage(ReconstructionStage):
    """Deformation from tracked points alone."""

    parts = ("vae", "ldrm", "deformation")

    def render(self, batch: ClipBatch) -> RenderedScenes:
        """The deformed scenes at the targets."""
        return self.scenes.render_dynamic(batch, encode_video(self.vae, batch))

    def forward(self, batch: ClipBatch) -> Terms:
        """The motion loss at the target times."""
        offsets = self.scenes.displacements(batch, encode_video(self.vae, batch))
        return weighted_sum([motion_term(offsets, batch, self.plan.recipe.losses)])
