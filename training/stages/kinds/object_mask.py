"""The object mask: the pixels that prompts ask to move, many prompts for every image.

    images, with random light ─ object mask ─ features ─┐
    captions ─ text encoder (frozen) ─ queries ─────────┴ logits ─ cross-entropy, overlap

The features alone also give noun and colour of every pixel, and which pixels are one object.
Captions name every object of an image in turn, some that it does not show, and none.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.models.motion_unet.text_tokens import TextTokens, text_tokens
from diff4splat.models.networks import Networks
from diff4splat.models.object_mask.enlarged import enlarged, reduced
from diff4splat.models.object_mask.instance_vectors import membership_logits
from diff4splat.training.batches.coarse_images import coarse
from diff4splat.training.batches.random_images.random_light import draw_light
from diff4splat.training.batches.requests.instance_seeds import draw_seeds, stack_seeds
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.losses.object_mask import (
    cross_entropy,
    dice_error,
    instance_error,
    name_error,
)
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import mask_preview
from diff4splat.training.stages.text_conditioning import TextConditioning


class ObjectMaskStage(ModelStage):
    """The object mask alone."""

    parts = ("text_encoder", "object_mask")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        # Processors differentiate depthwise convolutions faster so.
        self.object_mask.to(memory_format=torch.channels_last)
        self._text = TextConditioning(encoder=networks.text_encoder, plan=plan)

    def forward(self, batch: RequestBatch) -> Terms:
        """The terms ``cross_entropy``, ``dice`` and ``names``, and ``instances`` where it counts.

        The first three are 0 for images whose requests do not count.
        """
        losses, counts = self.plan.recipe.losses, batch.has_requests
        rgb = self._random_light(self._random_sharpness(batch), batch)
        features = self._features(rgb)
        logits = self._logits_of(features, batch)
        errors = {
            "cross_entropy": lambda: cross_entropy(logits, batch.masks) * counts,
            "dice": lambda: dice_error(logits, batch.masks) * counts,
            "names": lambda: self._name_error(features, batch) * counts,
            "instances": lambda: self._instance_error(features, batch),
        }
        return weighted_sum(
            [
                LossTerm(name=name, weight=getattr(losses, name), compute=compute)
                for name, compute in errors.items()
            ]
        )

    @torch.no_grad()
    def measure(self, batch: RequestBatch) -> Terms:
        """Shares over prompts; NaN for images whose prompts are all of the other kind.

        ``overlap`` and ``found``: of the objects asked for, mean overlap, and whether the most
        probable pixel is on them. ``absent_empty``: none is probable where nothing is
        asked for.
        """
        logits = self._logits(_rgb(batch.images), batch).flatten(2)
        truth, predicted = batch.masks.flatten(2), logits > 0
        asked = truth.any(-1)
        shared, either = (truth & predicted).sum(-1), (truth | predicted).sum(-1)
        best = truth.gather(-1, logits.argmax(-1, keepdim=True))[..., 0]
        return {
            "overlap": _mean_where(shared / either.clamp_min(1), asked),
            "found": _mean_where(best.double(), asked),
            "absent_empty": _mean_where((either == 0).double(), ~asked),
        }

    @torch.no_grad()
    def panel(self, batch: RequestBatch) -> Float[Tensor, "h w 3"]:
        """The first image, its true masks, and the predicted ones."""
        rgb = _rgb(batch.images)
        return mask_preview(rgb, batch.masks, self._logits(rgb, batch).sigmoid())

    def _logits(
        self, rgb: Float[Tensor, "b 3 h w"], batch: RequestBatch
    ) -> Float[Tensor, "b r h w"]:
        """Of all prompts, at the size of the masks."""
        return self._logits_of(self._features(rgb), batch)

    def _features(self, rgb: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c h2 w2"]:
        images = enlarged(rgb).contiguous(memory_format=torch.channels_last)
        return self.object_mask.features(images)

    def _logits_of(
        self, features: Float[Tensor, "b c h2 w2"], batch: RequestBatch
    ) -> Float[Tensor, "b r h w"]:
        logits = self.object_mask.logits(features, self._tokens(batch))
        return reduced(logits, batch.masks.shape[-2:])

    def _tokens(self, batch: RequestBatch) -> TextTokens:
        return text_tokens(*self._text.encode(batch, training=False))

    def _name_error(
        self, features: Float[Tensor, "b c h2 w2"], batch: RequestBatch
    ) -> Float[Tensor, " b"]:
        """Of noun and colour, one pixel of every cell: neighbours say the same."""
        truth, size = (batch.nouns, batch.colors), features.shape[-2:]
        return sum(
            name_error(found, _nearest(names, size))
            for found, names in zip(self.object_mask.name_logits(features), truth, strict=True)
        )

    def _instance_error(
        self, features: Float[Tensor, "b c h2 w2"], batch: RequestBatch
    ) -> Float[Tensor, " b"]:
        """Of the objects of random seeds."""
        size = batch.objects.shape[-2:]
        vectors = reduced(self.object_mask.instances(features), size)
        pairs = zip(batch.objects, self.random.per_sample(batch, "seeds"), strict=True)
        seeds = stack_seeds([draw_seeds(numbers, generator) for numbers, generator in pairs])
        logits = membership_logits(vectors, seeds.weights.to(vectors))
        return instance_error(logits, seeds.masks, seeds.valid)

    def _random_sharpness(self, batch: RequestBatch) -> Float[Tensor, "b 3 h w"]:
        """All images of a step as sharp as one of the recipe's sides."""
        sides = self.plan.recipe.data.view_sides_px
        if not sides:
            return _rgb(batch.images)
        index = torch.randint(len(sides), (), generator=self.random.per_step(batch, "view size"))
        factor = max(batch.images.shape[2] // sides[int(index)], 1)
        images = batch.images if factor == 1 else coarse(batch.images, factor)
        return _rgb(images)

    def _random_light(
        self, rgb: Float[Tensor, "b 3 h w"], batch: RequestBatch
    ) -> Float[Tensor, "b 3 h w"]:
        """Another exposure, white balance and noise for every image."""
        light = draw_light(self.random.per_sample(batch, "light"), rgb)
        return light.noisy(light.lit(rgb), self.random.per_step(batch, "noise"))


def _rgb(images: Tensor) -> Float[Tensor, "b 3 h w"]:
    return unit_rgb(images).movedim(-1, 1)


def _nearest(names: Tensor, size: tuple[int, int]) -> Int[Tensor, "b h2 w2"]:
    """Numbers of the names at another size."""
    resized = torch.nn.functional.interpolate(names[:, None].float(), size, mode="nearest-exact")
    return resized[:, 0].long()


def _mean_where(values: Float[Tensor, "b r"], mask: Bool[Tensor, "b r"]) -> Float[Tensor, " b"]:
    kept = torch.where(mask, values, torch.zeros_like(values)).sum(1)
    count = mask.sum(1)
    return torch.where(count > 0, kept / count.clamp_min(1), torch.nan)
