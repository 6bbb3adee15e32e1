"""The motion network: flow matching on the true motion of a first image.

    first image, mask of one object ───────────────┐
    captions ─ text encoder (frozen) ──────────────┤
    motion ─ (1 − level) clean + level noise ─ motion network ─ clean motion ─ velocity ─ loss

No other network of the video model runs or learns.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.flow.path import add_noise, velocity_from_clean
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.models.networks import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.coarse_images import enlarged, with_coarse_images
from diff4splat.training.batches.mask_condition import with_object_masks
from diff4splat.training.batches.random_flip import flip_samples
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.object_mask import cross_entropy
from diff4splat.training.losses.timestep_sampling import (
    LevelDistribution,
    min_level_weights,
    sample_levels,
)
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.paraphrases import paraphrase_error
from diff4splat.training.stages.previews import motion_preview
from diff4splat.training.stages.text_conditioning import TextConditioning
from diff4splat.training.stages.video_flow import EVAL_LEVELS, EVAL_NOISE


@dataclass(frozen=True, slots=True, kw_only=True)
class NoisyMotion:
    """A point on the path between a true motion, without its first frame, and noise."""

    clean: Float[Tensor, "b 3 t1 hc wc"]
    noise: Float[Tensor, "b 3 t1 hc wc"]
    level: Float[Tensor, " b"]

    @property
    def motion(self) -> Float[Tensor, "b 3 t1 hc wc"]:
        """Input of the network."""
        return add_noise(self.clean, self.noise, self.level)

    def error(
        self,
        clean: Float[Tensor, "b 3 t1 hc wc"],
        weights: Float[Tensor, " b"] | None = None,
        cells: Float[Tensor, "b hc wc"] | None = None,
    ) -> Float[Tensor, " b"]:
        """Mean squared error of the velocity that a predicted clean motion implies."""
        level = self.level[:, None, None, None, None]
        velocity = velocity_from_clean(self.motion, clean, level)
        shares = None if cells is None else cells[:, None].expand_as(self.clean[:, 0])
        return flow_matching(velocity, self.clean, self.noise, weights=weights, cells=shares)


class MotionDiffusionStage(ModelStage):
    """The motion network alone."""

    parts = ("text_encoder", "motion_unet")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self._text = TextConditioning(encoder=networks.text_encoder, plan=plan)

    def forward(self, batch: ClipBatch) -> Terms:
        """The terms ``flow``, ``motion_mask`` and ``paraphrase``."""
        batch, losses = self._augmented(self._enlarged(batch)), self.plan.recipe.losses
        batch, masks = self._object_masks(batch)
        uniform = self.random.uniform(batch, "level")
        level = sample_levels(uniform, LevelDistribution(shift=self.plan.recipe.timestep_shift))
        noisy = self._noisy(batch, level.to(batch.field), "noise")
        clean, logits = self._predicted(self._inputs(batch, noisy, masks))
        known = batch.motion_known.to(clean)
        unmasked = known if masks is None else known * ~masks.flatten(1).any(1)
        cells = None if masks is None else _cell_weights(batch.moving)
        weights = min_level_weights(noisy.level, losses.min_level_weighting)
        return weighted_sum(
            [
                LossTerm(
                    name="flow",
                    weight=losses.flow,
                    compute=lambda: known * noisy.error(clean, weights, cells),
                ),
                LossTerm(
                    name="motion_mask",
                    weight=losses.motion_mask,
                    compute=lambda: unmasked * cross_entropy(logits, batch.moving),
                ),
                LossTerm(
                    name="paraphrase",
                    weight=losses.paraphrase,
                    compute=lambda: self._paraphrase_error(batch),
                ),
            ]
        )

    def _predicted(
        self, inputs: tuple[Tensor | None, ...]
    ) -> tuple[Float[Tensor, "b 3 t1 hc wc"], Float[Tensor, "b h w"] | None]:
        """Clean motion, and the logits of the mask where a loss asks for them."""
        if self.plan.recipe.losses.motion_mask == 0:
            return self.motion_unet(*inputs), None
        return self.motion_unet.predict_motion_and_mask(*inputs)

    def _paraphrase_error(self, batch: ClipBatch) -> Float[Tensor, " b"]:
        return paraphrase_error(
            self.motion_unet,
            self._text,
            self.random.per_sample(batch, "sentences"),
            self.random.per_step(batch, "features"),
        )

    def _enlarged(self, batch: ClipBatch) -> ClipBatch:
        """At the side that the network sees, where clips have the model's own."""
        model = self.plan.model
        side = model.size_px[1] * model.motion_unet.input_scale
        return enlarged(batch, max(side // batch.video.shape[3], 1))

    def _augmented(self, batch: ClipBatch) -> ClipBatch:
        """Half of the samples mirrored, with images as sharp as one of the recipe's sides."""
        batch, sides = self.randomly_flipped(batch), self.plan.recipe.data.view_sides_px
        if not sides:
            return batch
        generator = self.random.per_step(batch, "view size")
        return with_coarse_images(
            batch, sides[int(torch.randint(len(sides), (), generator=generator))]
        )

    def _object_masks(self, batch: ClipBatch) -> tuple[ClipBatch, Float[Tensor, "b h w"] | None]:
        """One object of every sample with about its mask, if the network is shown masks."""
        if not self.plan.model.motion_unet.object_mask:
            return batch, None
        return with_object_masks(batch, self.random.per_sample(batch, "object mask"))

    def randomly_flipped(self, batch: ClipBatch) -> ClipBatch:
        """Half of the samples mirrored."""
        draws = self.random.per_sample(batch, "mirror")
        return flip_samples(batch, [bool(torch.rand((), generator=own) < 0.5) for own in draws])

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``flow_error`` over fixed levels, and ``motion_share``.

        ``motion_share`` is the squared error of the motion predicted from noise alone, over that of
        no motion; NaN where nothing moves.
        """
        batch = self._enlarged(batch)
        level = batch.field.new_ones(len(batch))
        noisy = [self._noisy(batch, fixed * level, EVAL_NOISE) for fixed in EVAL_LEVELS]
        errors = [one.error(self._clean(batch, one)) for one in noisy]
        clean, predicted = batch.field[:, :, 1:], self._from_noise(batch)
        static = clean.square().flatten(1).mean(1)
        share = (predicted - clean).square().flatten(1).mean(1) / static
        return {
            "flow_error": torch.where(batch.motion_known, torch.stack(errors).mean(0), torch.nan),
            "motion_share": torch.where(static > 0, share, torch.nan),
        }

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """First images, true motion, and the motion predicted from noise alone."""
        batch = self._enlarged(batch)
        return motion_preview(batch.field[:, :, 1:], self._from_noise(batch), batch)

    def _noisy(self, batch: ClipBatch, level: Float[Tensor, " b"], purpose: str) -> NoisyMotion:
        clean = batch.field[:, :, 1:]
        noise = self.random.normal(batch, clean, purpose)
        return NoisyMotion(clean=clean, noise=noise, level=level)

    def _inputs(
        self, batch: ClipBatch, noisy: NoisyMotion, masks: Float[Tensor, "b h w"] | None
    ) -> tuple[Tensor | None, ...]:
        text, mask = self._text.encode_or_drop(batch, self.training)
        rgb = unit_rgb(batch.video[:, 0]).movedim(-1, 1)
        return rgb, noisy.motion, noisy.level, text, mask, masks

    def _clean(self, batch: ClipBatch, noisy: NoisyMotion) -> Float[Tensor, "b 3 t1 hc wc"]:
        shown = self.plan.model.motion_unet.object_mask
        masks = batch.moving.to(noisy.clean) if shown else None
        return self.motion_unet(*self._inputs(batch, noisy, masks))

    def _from_noise(self, batch: ClipBatch) -> Float[Tensor, "b 3 t1 hc wc"]:
        """Clean motion in one step from noise."""
        return self._clean(batch, self._noisy(batch, batch.field.new_ones(len(batch)), EVAL_NOISE))


def _cell_weights(moving: Bool[Tensor, "b h w"]) -> Float[Tensor, "b hc wc"]:
    """Half of the weight on the cells of the object, half on all: outside is only its extension."""
    inside = torch.nn.functional.max_pool2d(moving.float(), MOTION_CELL_PX)
    return 1 + inside * inside[0].numel() / inside.flatten(1).sum(1).clamp_min(1)[:, None, None]
