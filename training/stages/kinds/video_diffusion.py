"""The video diffusion model: flow matching on the latents of true videos.

video ─ vae (frozen) ─ clean latent ─────────┐
captions ─ text encoder ─────────────────────┤
cameras ─ Plücker maps ──────────────────────┴─ flow matching
first image ─ render condition ──────────────┘
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import clean_from_velocity
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.latents.video_latents import encode_batch, image_video
from diff4splat.training.recipe.losses import FlowLosses
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import Row, preview
from diff4splat.training.stages.video_flow import EVAL_LEVELS, VideoFlow, condition_parts


class VideoDiffusionStage(ModelStage):
    """Video DiT and text encoder."""

    parts = ("vae", "text_encoder", "dit")

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """The depth prior makes the render conditions."""
        return (*cls.parts, *condition_parts(model))

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self._model = Model(config=plan.model, networks=networks)
        self.flow = VideoFlow(networks, plan, self.flow_losses(plan))

    def flow_losses(self, plan: StagePlan) -> FlowLosses:
        """Weights of the error of a velocity."""
        return plan.recipe.losses

    def forward(self, batch: ClipBatch | LatentBatch) -> Terms:
        """The term ``flow``."""
        return self.flow.terms(self.encoded(batch), self.training)

    def encoded(self, batch: ClipBatch | LatentBatch) -> LatentBatch:
        """Latents and render conditions; those of clips are made here, by frozen networks."""
        return batch if isinstance(batch, LatentBatch) else encode_batch(self._model, batch)

    @torch.no_grad()
    def measure(self, batch: ClipBatch | LatentBatch) -> Terms:
        """``flow_error`` and ``hidden_error`` over fixed levels."""
        return self.flow.measures(self.encoded(batch), self.training)

    @torch.no_grad()
    def panel(self, batch: ClipBatch | LatentBatch) -> Float[Tensor, "h w 3"]:
        """Truth, render condition, and the clean video predicted from each evaluation level."""
        batch = self.encoded(batch)
        rows: list[Row] = [("truth", self._images(batch.latent))]
        if batch.render_latent is not None:
            rows.append(("render condition", self._images(batch.render_latent)))
        rows += [(f"from level {level:g}", self._predicted(batch, level)) for level in EVAL_LEVELS]
        return preview(rows)

    def _predicted(self, batch: LatentBatch, level: float) -> list[Tensor]:
        video = self.flow.at_level(batch, level)
        velocity = self.flow.velocity(batch, video, self.training)
        clean = clean_from_velocity(video.latent, velocity, video.level)
        return self._images(torch.cat([batch.latent[:, :, :1], clean[:, :, 1:]], 2))

    def _images(self, latent: Float[Tensor, "b c t h w"]) -> list[Tensor]:
        return list(image_video(self.vae.decode(latent[:1]))[0].clamp(0, 1))
