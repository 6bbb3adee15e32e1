"""The video model: flow matching on the latents of true videos (Diff4Splat, flow matching).

    video ─ vae (frozen) ─ clean ── (1 − level) clean + level noise ─ dit ─ velocity ─ loss
                                    first latent frame: clean, level 0, no loss
    captions ─ text encoder ─┐
    cameras ─ Plücker maps ──┤
    first picture ─ draft ───┴─ conditions

How captions are varied and dropped stands in ``captioned``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import add_noise, clean_from_velocity
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.render_condition import render_condition_latent
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.motion_unet.motion_field import append_zero_motion, pack_motion
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.level_draws import LevelDraw, draw_levels, level_weights
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.captioned import TextConditionedStage
from diff4splat.training.stages.model_stage import camera_rays, shown_video
from diff4splat.training.stages.panels import Row, panel

Terms = Mapping[str, Float[Tensor, " b"]]

JUDGED_LEVELS = (0.25, 0.5, 0.75)
"""Noise levels at which evaluation measures the velocity."""


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


class VideoDiffusionStage(TextConditionedStage):
    """Video DiT and text encoder."""

    parts = ("vae", "text_encoder", "dit")

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """Drafts are made by LDRM."""
        drafts = model.dit.draft and "ldrm" not in cls.parts
        return (*cls.parts, "ldrm") if drafts else cls.parts

    def forward(self, batch: ClipBatch | LatentBatch) -> Terms:
        """The term ``flow``."""
        return self.flow_terms(self.encoded(batch))

    @torch.no_grad()
    def encoded(self, batch: ClipBatch | LatentBatch) -> LatentBatch:
        """Latents and drafts; of clips they are made here, by frozen networks."""
        if isinstance(batch, LatentBatch):
            return batch
        return LatentBatch(
            sample_index=batch.sample_index,
            source=batch.source,
            latent=self.encode(batch),
            draft=self._drafts(batch) if self.plan.model.dit.draft else None,
            motion=self._motion(batch),
            cameras=batch.cameras,
            captions=batch.captions,
        )

    def _motion(self, batch: ClipBatch) -> Float[Tensor, "b m t h w"]:
        model = self.plan.model
        return pack_motion(batch.motion, model.vae.space_stride)[:, : model.motion_channels]

    def _drafts(self, batch: ClipBatch) -> Float[Tensor, "b c t h w"]:
        rows = []
        for index in range(len(batch)):
            cameras, rgb = batch.cameras[index], unit_rgb(batch.video[index, 0])
            picture = InputImage(rgb=rgb, camera=cameras[0], focal_source="clip")
            rows.append(render_condition_latent(self.model, picture, cameras))
        return torch.cat(rows)

    def flow_terms(self, batch: LatentBatch) -> Terms:
        """Flow matching at one level per sample, for the latents of the batch."""
        video, weights = self.noisy(batch), self.plan.recipe.losses
        velocity = self.velocity(batch, video, self.drops_text(batch))
        flow = self._flow(velocity, video, level_weights(video.level, weights.flow_level))
        return {"flow": flow, TOTAL: weights.flow * flow}

    def _flow(
        self, velocity: Tensor, video: NoisyVideo, weights: Float[Tensor, " b"] | None = None
    ) -> Float[Tensor, " b"]:
        return flow_matching(
            velocity,
            video.clean,
            video.noise,
            first_frame_is_clean=True,
            weights=weights,
            channels=self._channels,
        )

    @cached_property
    def _channels(self) -> Float[Tensor, " c"]:
        """How much each channel counts: those of the latent 1 on average."""
        losses, model = self.plan.recipe.losses, self.plan.model
        share = torch.ones_like(self.vae.latent_std)
        if self.vae.code is not None:
            share = (self.vae.code.energy() * self.vae.latent_std.square()).pow(losses.flow_energy)
        motion = share.new_full((model.motion_channels,), losses.flow_motion)
        return torch.cat([share / share.mean(), motion])

    def noisy(self, batch: LatentBatch) -> NoisyVideo:
        """Noise and level of every sample."""
        uniform = torch.cat([torch.rand(1, generator=own) for own in self.draw(batch, "level")])
        level = draw_levels(uniform, LevelDraw(shift=self.plan.recipe.level_shift))
        clean = self.clean(batch)
        return NoisyVideo(
            clean=clean, noise=self.noise(batch, clean, "noise"), level=level.to(clean)
        )

    def clean(self, batch: LatentBatch) -> Float[Tensor, "b c t h w"]:
        """What the video model makes: latents, and motion behind them."""
        return torch.cat([batch.latent, batch.motion], 1)

    def velocity(
        self, batch: LatentBatch, video: NoisyVideo, without_text: bool = False
    ) -> Float[Tensor, "b c t h w"]:
        """The model's answer."""
        return self.velocity_at(batch, video.latent, video.levels, without_text)

    def velocity_at(
        self,
        batch: LatentBatch,
        latent: Float[Tensor, "b c t h w"],
        levels: Float[Tensor, "b t"],
        without_text: bool = False,
    ) -> Float[Tensor, "b c t h w"]:
        """The model's answer for any latent."""
        text, mask = (None, None) if without_text else self.text(batch)
        channels, draft = self.plan.model.motion_channels, batch.draft
        draft = None if draft is None else append_zero_motion(draft, channels)
        return self.dit(latent, levels, camera_rays(batch.cameras), text, mask, draft)

    @torch.no_grad()
    def measure(self, batch: ClipBatch | LatentBatch) -> Terms:
        """``flow_error``: mean squared error of the velocity over fixed levels."""
        return self.flow_measures(self.encoded(batch))

    def flow_measures(self, batch: LatentBatch) -> Terms:
        """The same for the latents of the batch."""
        videos = [self._at_level(batch, level) for level in JUDGED_LEVELS]
        errors = [self._flow(self.velocity(batch, video), video) for video in videos]
        return {"flow_error": torch.stack(errors).mean(0)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch | LatentBatch) -> Float[Tensor, "h w 3"]:
        """Truth, the draft, and what one step from each judged level takes the video for."""
        batch = self.encoded(batch)
        rows: list[Row] = [("truth", self._shown(batch.latent))]
        if batch.draft is not None:
            rows.append(("draft", self._shown(batch.draft)))
        for level in JUDGED_LEVELS:
            video = self._at_level(batch, level)
            guess = clean_from_velocity(video.latent, self.velocity(batch, video), video.level)
            guess = torch.cat([batch.latent[:, :, :1], self.latents(guess)[:, :, 1:]], 2)
            rows.append((f"from level {level:g}", self._shown(guess)))
        return panel(rows)

    def latents(self, made: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b d t h w"]:
        """Without the motion behind them."""
        return made[:, : self.plan.model.vae.latent_channels]

    def _shown(self, latent: Float[Tensor, "b c t h w"]) -> list[Tensor]:
        return list(shown_video(self.vae.decode(latent[:1]))[0].clamp(0, 1))

    def _at_level(self, batch: LatentBatch, level: float) -> NoisyVideo:
        clean = self.clean(batch)
        levels = clean.new_full((len(clean),), level)
        return NoisyVideo(clean=clean, noise=self.noise(batch, clean, "judged"), level=levels)
