"""What stages share that reconstruct a clip and compare its renders."""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.networks import Networks, ldrm_start_parts
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stages.input_selection import InputSelection
from diff4splat.training.stages.metrics import reconstruction_metrics
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import reconstruction_preview
from diff4splat.training.stages.scene_prediction import RenderedScenes, ScenePredictor


class ReconstructionStage(ModelStage):
    """Renders of the scenes that the networks predict, with their metrics and preview.

    Abstract: a kind says which parts run, how it renders a batch, and which losses it has.
    """

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """LDRM may start from the depth prior's depth."""
        return (*cls.parts, *ldrm_start_parts(model))

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.inputs = InputSelection(
            random=self.random, single_image_probability=plan.recipe.single_image_probability
        )
        self.scenes = ScenePredictor(networks=networks, plan=plan)

    def render(self, batch: ClipBatch) -> RenderedScenes:
        """Renders at the targets from the input frames of ``batch``."""
        raise NotImplementedError

    def predict(self, batch: ClipBatch) -> tuple[ClipBatch, RenderedScenes]:
        """The selected input, and the renders at its targets."""
        batch = self.inputs.select(batch, self.training)
        return batch, self.render(batch)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """PSNR and depth correlation at the targets, and the displacement error if it moves."""
        batch, rendered = self.predict(batch)
        return reconstruction_metrics(rendered, batch)

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Input, truth, prediction, both depths and, if there is any, motion."""
        batch, rendered = self.predict(batch)
        return reconstruction_preview(rendered, batch)
