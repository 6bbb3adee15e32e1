"""A video model of few steps, taught by the model that it starts as.

true latents, noised to a step's level ─┬─ teacher (frozen): small steps to the next level ─ mean┐
                                        └─ student: one velocity ──────────────────────────── error┘

The student is the network itself, without another input: Euler with ``segments`` even levels and no
guidance does what the teacher does in ``segments`` · ``teacher_steps`` steps with it.
"""

from copy import deepcopy
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import clean_from_velocity, noise_from_velocity
from diff4splat.models.networks import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.latents.video_latents import camera_rays
from diff4splat.training.losses.mean_velocity import mean_velocity, segment_of
from diff4splat.training.losses.timestep_sampling import min_level_weights
from diff4splat.training.recipe.losses import FlowLosses
from diff4splat.training.stages.kinds.video_diffusion import VideoDiffusionStage
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import StagePlan, Terms
from diff4splat.training.stages.text_conditioning import TextConditioning
from diff4splat.training.stages.video_flow import EVAL_NOISE, NoisyVideo


class VideoDistillationStage(VideoDiffusionStage):
    """The video DiT learns to take few steps."""

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        # No submodule: it is that of the networks at the start, and no checkpoint stores it.
        self._teacher = (deepcopy(networks.dit).requires_grad_(requires_grad=False).eval(),)
        super().__init__(networks, plan)
        self._losses = plan.recipe.losses
        self._text = TextConditioning(encoder=networks.text_encoder, plan=plan)

    def flow_losses(self, plan: StagePlan) -> FlowLosses:
        """Weights of the error of a velocity."""
        return plan.recipe.losses.flow

    def forward(self, batch: ClipBatch | LatentBatch) -> Terms:
        """The term ``distillation`` at the level of one step per sample."""
        batch = self.encoded(batch)
        start, end = segment_of(self.random.uniform(batch, "level"), self._losses.segments)
        video, taught = self.taught(batch, (start, end), "noise")
        velocity = self.flow.velocity(batch, video, self.training)
        losses = self._losses.flow
        weights = min_level_weights(video.level, losses.min_level_weighting)
        return weighted_sum(
            [
                LossTerm(
                    name="distillation",
                    weight=losses.flow,
                    compute=lambda: self.flow.error(
                        velocity, taught, weights, self.flow.cells(batch)
                    ),
                )
            ]
        )

    @torch.no_grad()
    def measure(self, batch: ClipBatch | LatentBatch) -> Terms:
        """``distillation_error``: squared error against the teacher, mean over the steps."""
        batch, segments = self.encoded(batch), self._losses.segments
        errors = []
        for number in range(segments):
            ends = [torch.full((len(batch),), (number + up) / segments) for up in (1, 0)]
            video, taught = self.taught(batch, (ends[0], ends[1]), EVAL_NOISE)
            velocity = self.flow.velocity(batch, video, self.training)
            errors.append(self.flow.error(velocity, taught))
        return {"distillation_error": torch.stack(errors).mean(0)}

    @torch.no_grad()
    def taught(
        self,
        batch: LatentBatch,
        levels: tuple[Float[Tensor, " b"], Float[Tensor, " b"]],
        purpose: str,
    ) -> tuple[NoisyVideo, NoisyVideo]:
        """The latents at the first level, and the path of the teacher's velocity through them.

        That velocity is the mean down to the second level; the path is straight.
        """
        video = self.flow.with_noise(batch, levels[0], purpose)
        found = mean_velocity(
            lambda state, level: self._taught_velocity(batch, video, state, level),
            video.latent,
            video.level,
            levels[1].to(video.level),
            self._losses.teacher_steps,
        )
        return video, replace(
            video,
            clean=clean_from_velocity(video.latent, found, video.level),
            noise=noise_from_velocity(video.latent, found, video.level),
        )

    def _taught_velocity(
        self, batch: LatentBatch, video: NoisyVideo, state: Tensor, level: Float[Tensor, " b"]
    ) -> Float[Tensor, "b c t h w"]:
        """With guidance where it applies; the first frame stays."""
        (teacher,) = self._teacher
        teacher = teacher.to(state.device)
        levels = replace(video, level=level).levels
        rays, rendered = camera_rays(batch.cameras), batch.render_condition
        # Captions as they are: both networks read the same words.
        found = teacher(state, levels, rays, *self._text.encode(batch, self.training), rendered)
        weight = self._losses.guidance
        if weight != 1 and bool((level > self._losses.guidance_low).any()):
            free = teacher(state, levels, rays, None, None, rendered)
            guided = (level > self._losses.guidance_low)[:, None, None, None, None]
            found = torch.where(guided, free + weight * (found - free), found)
        return torch.cat([torch.zeros_like(found[:, :, :1]), found[:, :, 1:]], 2)
