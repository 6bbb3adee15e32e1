"""Flow matching on latents: noisy videos, predicted velocities, and their error.

    clean ── (1 − level) clean + level noise ─ dit ─ velocity ─ loss
             first latent frame: clean, level 0, no loss

Axes: ``b`` batch, ``c t h w`` latents.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import add_noise
from diff4splat.models.blocks.patches import fill_first_pack
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.networks import Networks
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.latents.video_latents import camera_rays
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.timestep_sampling import (
    LevelDistribution,
    min_level_weights,
    sample_levels,
)
from diff4splat.training.recipe.losses import FlowLosses
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import StagePlan, Terms
from diff4splat.training.stages.text_conditioning import TextConditioning

EVAL_LEVELS = (0.25, 0.5, 0.75)
"""Noise levels at which evaluation measures the velocity."""
EVAL_NOISE = "judged"
"""Purpose of the noise in evaluation. It seeds the draws, so another word would change them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoisyVideo:
    """A point on the path between a clean latent and noise."""

    clean: Float[Tensor, "b c t h w"]
    noise: Float[Tensor, "b c t h w"]
    level: Float[Tensor, " b"]

    @property
    def latent(self) -> Float[Tensor, "b c t h w"]:
        """With the first frame clean: it is the image that the video starts from."""
        noisy = add_noise(self.clean, self.noise, self.level)
        return torch.cat([self.clean[:, :, :1], noisy[:, :, 1:]], 2)

    @property
    def levels(self) -> Float[Tensor, "b t"]:
        """One per latent frame; 0 for the first."""
        frames = self.clean.shape[2]
        return self.level[:, None] * (torch.arange(frames, device=self.level.device) > 0)


class VideoFlow:
    """The video diffusion model of a stage, its loss and its measure."""

    def __init__(self, networks: Networks, plan: StagePlan, losses: FlowLosses) -> None:
        self._networks, self._plan, self._losses = networks, plan, losses
        self._text = TextConditioning(encoder=networks.text_encoder, plan=plan)

    def terms(self, batch: LatentBatch, training: bool) -> Terms:
        """The term ``flow`` at one level per sample."""
        video, losses = self.noisy(batch), self._losses
        condition = self._text.encode_or_drop(batch, training)
        velocity = self._velocity(batch, video.latent, video.levels, condition)
        weights = min_level_weights(video.level, losses.min_level_weighting)
        return weighted_sum(
            [
                LossTerm(
                    name="flow",
                    weight=losses.flow,
                    compute=lambda: self.error(velocity, video, weights, self.cells(batch)),
                )
            ]
        )

    def measures(self, batch: LatentBatch, training: bool) -> Terms:
        """``flow_error``: mean squared error of the velocity over fixed levels.

        ``hidden_error`` is the same, weighted by how much of a latent cell the first frame hides;
        NaN where it hides nothing.
        """
        videos = [self.at_level(batch, level) for level in EVAL_LEVELS]
        predicted = [self.velocity(batch, one, training) for one in videos]
        pairs, hidden = list(zip(predicted, videos, strict=True)), hidden_share(batch)
        measured = {"flow_error": self._mean_error(pairs)}
        if hidden is not None:
            applies = hidden[:, 1:].flatten(1).any(1)
            error = self._mean_error(pairs, hidden)
            measured["hidden_error"] = torch.where(applies, error, torch.nan)
        return measured

    def _mean_error(
        self,
        pairs: list[tuple[Tensor, NoisyVideo]],
        cells: Float[Tensor, "b t h w"] | None = None,
    ) -> Float[Tensor, " b"]:
        """The mean error of predicted velocities."""
        errors = [self.error(velocity, video, cells=cells) for velocity, video in pairs]
        return torch.stack(errors).mean(0)

    def noisy(self, batch: LatentBatch) -> NoisyVideo:
        """Noise and level of every sample."""
        uniform = self._plan.random.uniform(batch, "level")
        level = sample_levels(uniform, LevelDistribution(shift=self._plan.recipe.timestep_shift))
        return self.with_noise(batch, level, "noise")

    def at_level(self, batch: LatentBatch, level: float) -> NoisyVideo:
        """All samples at one level, with the noise of evaluation."""
        return self.with_noise(batch, batch.latent.new_full((len(batch),), level), EVAL_NOISE)

    def with_noise(
        self, batch: LatentBatch, level: Float[Tensor, " b"], purpose: str
    ) -> NoisyVideo:
        """The latents of a batch, with noise drawn for a purpose."""
        noise = self._plan.random.normal(batch, batch.latent, purpose)
        return NoisyVideo(clean=batch.latent, noise=noise, level=level.to(batch.latent))

    def velocity(
        self, batch: LatentBatch, video: NoisyVideo, training: bool
    ) -> Float[Tensor, "b c t h w"]:
        """Predicted velocity with text."""
        return self.velocity_at(batch, video.latent, video.levels, training)

    def velocity_at(
        self,
        batch: LatentBatch,
        latent: Float[Tensor, "b c t h w"],
        levels: Float[Tensor, "b t"],
        training: bool,
    ) -> Float[Tensor, "b c t h w"]:
        """The same for any latent."""
        return self._velocity(batch, latent, levels, self._text.encode(batch, training))

    def _velocity(
        self, batch: LatentBatch, latent: Tensor, levels: Tensor, text: tuple[Tensor | None, ...]
    ) -> Float[Tensor, "b c t h w"]:
        rays = camera_rays(batch.cameras)
        return self._networks.dit(latent, levels, rays, *text, batch.render_condition)

    def error(
        self,
        velocity: Tensor,
        video: NoisyVideo,
        weights: Float[Tensor, " b"] | None = None,
        cells: Float[Tensor, "b t h w"] | None = None,
    ) -> Float[Tensor, " b"]:
        """Squared error of a velocity, with the weights of channels, and of cells where given."""
        return flow_matching(
            velocity,
            video.clean,
            video.noise,
            first_frame_is_clean=True,
            weights=weights,
            channels=self._channels,
            cells=cells,
        )

    def cells(self, batch: LatentBatch) -> Float[Tensor, "b t h w"] | None:
        """Weight of each latent cell: hidden ones count more."""
        share, weight = hidden_share(batch), self._losses.hidden_weight
        return None if share is None or weight == 1 else 1 + (weight - 1) * share

    @cached_property
    def _channels(self) -> Float[Tensor, " c"]:
        """Weight of each channel; latent channels have 1 on average."""
        losses, vae = self._losses, self._networks.vae
        share = torch.ones_like(vae.latent_std)
        if vae.pca_shortcut is not None:
            power = vae.pca_shortcut.channel_power() * vae.latent_std.square()
            share = power.pow(losses.channel_power_exponent)
        return share / share.mean()


def condition_parts(model: ModelConfig) -> tuple[str, ...]:
    """Names of the parts that make render conditions of a model, beside its autoencoder."""
    conditioned = model.dit.render_condition and model.monocular_depth.used
    return ("monocular_depth",) if conditioned else ()


def hidden_share(batch: LatentBatch) -> Float[Tensor, "b t h w"] | None:
    """How much of each latent cell the first frame hides; None without a render condition."""
    if batch.validity is None:
        return None
    side_px = batch.validity.shape[-1] // batch.latent.shape[-1]
    hidden = torch.nn.functional.avg_pool3d(1 - batch.validity, (1, side_px, side_px))
    # The first frame fills its pack of four.
    return fill_first_pack(hidden).unflatten(2, (-1, TIME_STRIDE)).mean(3)[:, 0]
