"""The video model: flow matching on the latents of true videos (Diff4Splat, flow matching).

    video ─ vae (frozen) ─ clean ── (1 − level) clean + level noise ─ dit ─ velocity ─ loss
                                    first latent frame: clean, level 0, no loss
    captions ─ text encoder ─┐
    cameras ─ Plücker maps ──┴─ conditions

Whole steps go without text, so that guidance has its unconditional branch and every process runs
the same networks: single samples without text would leave some processes waiting for others.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.flow.path import add_noise, clean_from_velocity
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.text_encoder import tokenize
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.level_draws import LevelDraw, draw_levels
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage, network_rays, shown_video
from diff4splat.training.stages.panels import Row, panel

UNSAID = "a scene"
"""What clips without a caption say, so that every process runs the text encoder alike."""
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


class GeneratorStage(ModelStage):
    """Video DiT and text encoder."""

    parts = ("vae", "text_encoder", "dit")

    def forward(self, batch: ClipBatch) -> Terms:
        """The term ``flow``."""
        return self.flow_terms(batch, self.encode(batch))

    def flow_terms(self, batch: ClipBatch, clean: Float[Tensor, "b c t h w"]) -> Terms:
        """Flow matching at one level per sample, for the latents of the batch."""
        video = self.noisy(batch, clean)
        velocity = self.velocity(batch, video, self._drops_text(batch))
        flow = flow_matching(velocity, video.clean, video.noise, first_frame_is_clean=True)
        return {"flow": flow, TOTAL: self.plan.recipe.losses.flow * flow}

    def noisy(self, batch: ClipBatch, clean: Float[Tensor, "b c t h w"]) -> NoisyVideo:
        """Noise and level of every sample."""
        uniform = torch.cat([torch.rand(1, generator=own) for own in self.draw(batch, "level")])
        level = draw_levels(uniform, LevelDraw(shift=self.plan.recipe.level_shift)).to(clean)
        return NoisyVideo(clean=clean, noise=self.noise(batch, clean, "noise"), level=level)

    def velocity(
        self, batch: ClipBatch, video: NoisyVideo, without_text: bool = False
    ) -> Float[Tensor, "b c t h w"]:
        """The model's answer."""
        return self.velocity_at(batch, video.latent, video.levels, without_text)

    def velocity_at(
        self,
        batch: ClipBatch,
        latent: Float[Tensor, "b c t h w"],
        levels: Float[Tensor, "b t"],
        without_text: bool = False,
    ) -> Float[Tensor, "b c t h w"]:
        """The model's answer for any latent."""
        text, mask = (None, None) if without_text else self._text(batch)
        return self.dit(latent, levels, network_rays(batch), text, mask)

    def _text(self, batch: ClipBatch) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        captions = [caption or UNSAID for caption in batch.captions]
        tokens, mask = tokenize(captions, self.plan.model.text.max_bytes)
        tokens, mask = tokens.to(batch.video.device), mask.to(batch.video.device)
        return self.text_encoder(tokens, mask), mask

    def _drops_text(self, batch: ClipBatch) -> bool:
        draw = torch.rand((), generator=self.draw_for_step(batch, "text"))
        return self.training and bool(draw < self.plan.recipe.text_dropout)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``flow_error``: mean squared error of the velocity over fixed levels."""
        return self.flow_measures(batch, self.encode(batch))

    def flow_measures(self, batch: ClipBatch, clean: Float[Tensor, "b c t h w"]) -> Terms:
        """The same for the latents of the batch."""
        errors = [self._error_at(batch, clean, level) for level in JUDGED_LEVELS]
        return {"flow_error": torch.stack(errors).mean(0)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Truth, and what one step from each judged level takes the clean video for."""
        clean = self.encode(batch)
        rows: list[Row] = [("truth", list(unit_rgb(batch.video[0])))]
        for level in JUDGED_LEVELS:
            video = self._at_level(batch, clean, level)
            guess = clean_from_velocity(video.latent, self.velocity(batch, video), video.level)
            guess = torch.cat([clean[:, :, :1], guess[:, :, 1:]], 2)
            decoded = shown_video(self.vae.decode(guess[:1]))[0].clamp(0, 1)
            rows.append((f"from level {level:g}", list(decoded)))
        return panel(rows)

    def _error_at(self, batch: ClipBatch, clean: Tensor, level: float) -> Float[Tensor, " b"]:
        video = self._at_level(batch, clean, level)
        return flow_matching(
            self.velocity(batch, video), clean, video.noise, first_frame_is_clean=True
        )

    def _at_level(self, batch: ClipBatch, clean: Tensor, level: float) -> NoisyVideo:
        levels = clean.new_full((len(clean),), level)
        return NoisyVideo(clean=clean, noise=self.noise(batch, clean, "judged"), level=levels)
