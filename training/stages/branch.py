"""The motion branch: flow matching on the true motion of what a first picture shows.

    first picture ─────────────────────────────────┐
    captions ─ text encoder (frozen) ──────────────┤
    motion ─ (1 − level) clean + level noise ─ motion branch ─ clean ─ velocity ─ loss

Nothing else of the video model runs or learns. Half of the samples are seen in a mirror, captions
included, so that nothing but the words says which side is left.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.captions.mirror import mirrored_caption
from diff4splat.flow.path import add_noise, velocity_from_clean
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.factory import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.level_draws import LevelDraw, draw_levels, level_weights
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.captioned import TextConditionedStage
from diff4splat.training.stages.generator import JUDGED_LEVELS
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.stages.panels import Row, panel

Terms = Mapping[str, Float[Tensor, " b"]]
TINT = 0.1
"""Share of a colour that a motion of 1 is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoisyMotion:
    """A point on the path between a true motion, without its first frame, and noise."""

    clean: Float[Tensor, "b 3 t1 hc wc"]
    noise: Float[Tensor, "b 3 t1 hc wc"]
    level: Float[Tensor, " b"]

    @property
    def motion(self) -> Float[Tensor, "b 3 t1 hc wc"]:
        """As the branch sees it."""
        return add_noise(self.clean, self.noise, self.level)


class MotionDiffusionStage(TextConditionedStage):
    """One branch of the video model."""

    parts = ("text_encoder", "dit")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.dit.requires_grad_(False)
        self.dit.motion_branch.requires_grad_(True)

    def forward(self, batch: ClipBatch) -> Terms:
        """The terms ``flow`` and, if it counts, ``moves``."""
        batch, weights = self._seen_in_mirrors(batch), self.plan.recipe.losses
        uniform = torch.cat([torch.rand(1, generator=own) for own in self.draw(batch, "level")])
        level = draw_levels(uniform, LevelDraw(shift=self.plan.recipe.level_shift))
        noisy = self._noisy(batch, level.to(batch.field), "noise")
        clean, logits = self.dit.motion_branch.answers(
            *self._asked(batch, noisy.motion, noisy.level)
        )
        terms = {"flow": self._error(noisy, clean, level_weights(noisy.level, weights.flow_level))}
        total = weights.flow * terms["flow"]
        if weights.moves:
            terms["moves"] = _missed(logits, batch.moving)
            total = total + weights.moves * terms["moves"]
        return terms | {TOTAL: total}

    def _noisy(self, batch: ClipBatch, level: Float[Tensor, " b"], purpose: str) -> NoisyMotion:
        clean = batch.field[:, :, 1:]
        return NoisyMotion(clean=clean, noise=self.noise(batch, clean, purpose), level=level)

    def _asked(
        self, batch: ClipBatch, motion: Tensor, level: Float[Tensor, " b"]
    ) -> tuple[Tensor | None, ...]:
        """What the branch is given."""
        text, mask = (None, None) if self.drops_text(batch) else self.text(batch)
        rgb = unit_rgb(batch.video[:, 0]).movedim(-1, 1)
        return rgb, motion, level, text, mask

    def _error(
        self, noisy: NoisyMotion, clean: Tensor, weights: Float[Tensor, " b"] | None = None
    ) -> Float[Tensor, " b"]:
        level = noisy.level[:, None, None, None, None]
        velocity = velocity_from_clean(noisy.motion, clean, level)
        return flow_matching(velocity, noisy.clean, noisy.noise, weights=weights)

    def clean(self, batch: ClipBatch, noisy: NoisyMotion) -> Float[Tensor, "b 3 t1 hc wc"]:
        """The branch's answer."""
        return self.dit.motion_branch(*self._asked(batch, noisy.motion, noisy.level))

    def _seen_in_mirrors(self, batch: ClipBatch) -> ClipBatch:
        """Some samples with left and right exchanged, in the picture, the motion and the words."""
        turned = [bool(torch.rand((), generator=own) < 0.5) for own in self.draw(batch, "mirror")]
        flip = torch.tensor(turned, device=batch.field.device)
        sign = batch.field.new_tensor([-1.0, 1.0, 1.0])[:, None, None, None]
        moving = torch.where(flip[:, None, None], batch.moving.flip(-1), batch.moving)
        flip = flip[:, None, None, None, None]
        field = torch.where(flip, batch.field.flip(-1) * sign, batch.field)
        video = torch.where(flip, batch.video.flip(-2), batch.video)
        captions = [
            mirrored_caption(caption) if own else caption
            for caption, own in zip(batch.captions, turned, strict=True)
        ]
        return replace(batch, video=video, field=field, moving=moving, captions=tuple(captions))

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``flow_error`` over fixed levels, and ``motion_share`` of the error of standing still.

        That share is of the motion guessed from noise alone.
        """
        level = batch.field.new_ones(len(batch))
        judged = [self._noisy(batch, own * level, "judged") for own in JUDGED_LEVELS]
        errors = [self._error(noisy, self.clean(batch, noisy)) for noisy in judged]
        clean, guess = batch.field[:, :, 1:], self._guess(batch)
        still = clean.square().flatten(1).mean(1)
        share = (guess - clean).square().flatten(1).mean(1) / still
        return {
            "flow_error": torch.stack(errors).mean(0),
            "motion_share": torch.where(still > 0, share, torch.nan),
        }

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Pictures, where things went, and where they are guessed to go from noise alone."""
        clean = batch.field[:, :, 1:]
        guess = self._guess(batch)
        rows: list[Row] = [
            ("picture", list(unit_rgb(batch.video[:, 0]))),
            ("motion: red right, green down, blue away", _tinted(clean, batch)),
            ("guess from noise", _tinted(guess, batch)),
        ]
        return panel(rows)

    def _guess(self, batch: ClipBatch) -> Float[Tensor, "b 3 t1 hc wc"]:
        """From noise alone, in one step."""
        return self.clean(batch, self._noisy(batch, batch.field.new_ones(len(batch)), "judged"))


def _missed(logits: Float[Tensor, "b h w"], moving: Bool[Tensor, "b h w"]) -> Float[Tensor, " b"]:
    """Cross-entropy of what moves."""
    missed = torch.nn.functional.binary_cross_entropy_with_logits(
        logits, moving.to(logits), reduction="none"
    )
    return missed.flatten(1).mean(1)


def _tinted(motion: Float[Tensor, "b 3 t1 hc wc"], batch: ClipBatch) -> list[Tensor]:
    """Motion at the end of the clip as colours, grey where nothing moves."""
    last = (0.5 + TINT * motion[:, :, -1]).clamp(0, 1)
    side = batch.video.shape[2] // last.shape[2]
    large = last.repeat_interleave(side, 2).repeat_interleave(side, 3)
    return list(large.movedim(1, -1).cpu())
