"""The object shadow: what one object takes from the light of all other pixels.

    image, mask that is not exact ─ object shadow ─ darkening ─┐
    image, the same without the object ─ true darkening ───────┴ errors

Axes: ``b`` images, ``h w`` pixels.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import max_pool2d

from diff4splat.io.pixels import unit_rgb
from diff4splat.models.networks import Networks
from diff4splat.training.batches.random_images.random_light import draw_light
from diff4splat.training.batches.shadows.shadow_batch import ShadowBatch
from diff4splat.training.losses.object_shadow import (
    darkening_error,
    lit_color_error,
    true_darkening,
)
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.previews import preview

MASK_ERROR_PX = 2
"""Most that a mask is too large or too small: predicted ones are not exact."""
LEAST_ERROR = 1e-5
"""Of an image whose object casts no shadow that could be measured."""


class ObjectShadowStage(ModelStage):
    """The object shadow alone."""

    parts = ("object_shadow",)

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.object_shadow.to(memory_format=torch.channels_last)

    def forward(self, batch: ShadowBatch) -> Terms:
        """The terms ``darkening`` and ``lit_colors``."""
        losses = self.plan.recipe.losses
        light = draw_light(self.random.per_sample(batch, "light"), _rgb(batch.images))
        image, without = (light.lit(_rgb(one)) for one in (batch.images, batch.without))
        noisy = light.noisy(image, self.random.per_step(batch, "noise"))
        image, without = image.clamp_max(1), without.clamp_max(1)
        found = self.object_shadow(noisy, self._random_mask(batch))
        truth, valid = true_darkening(image, without), ~grown(batch.masks, 1)
        return weighted_sum(
            [
                LossTerm(
                    name="darkening",
                    weight=losses.darkening,
                    compute=lambda: darkening_error(found, truth, valid),
                ),
                LossTerm(
                    name="lit_colors",
                    weight=losses.lit_colors,
                    compute=lambda: lit_color_error(found, image, without, valid),
                ),
            ]
        )

    @torch.no_grad()
    def measure(self, batch: ShadowBatch) -> Terms:
        """``explained``: share of the squared difference that taking the shadow off explains.

        NaN for images whose object casts no shadow.
        """
        image, without, found = self._predicted(batch)
        valid = ~grown(batch.masks, 1)
        left = lit_color_error(found, image, without, valid)
        whole = lit_color_error(torch.zeros_like(found), image, without, valid)
        share = 1 - left / whole.clamp_min(LEAST_ERROR)
        return {"explained": torch.where(whole > LEAST_ERROR, share, torch.nan)}

    @torch.no_grad()
    def panel(self, batch: ShadowBatch) -> Float[Tensor, "h w 3"]:
        """The first image, the same without its object, and without the predicted shadow."""
        image, without, found = self._predicted(batch)
        rows = {
            "image": image,
            "without the object": without,
            "without its shadow": (image * found.exp()).clamp(0, 1),
        }
        return preview([(name, [one[0].movedim(0, -1)]) for name, one in rows.items()])

    def _predicted(self, batch: ShadowBatch) -> tuple[Tensor, Tensor, Tensor]:
        image, without = _rgb(batch.images), _rgb(batch.without)
        found = self.object_shadow(image, batch.masks.to(image))
        return image, without, found.clamp_min(0)

    def _random_mask(self, batch: ShadowBatch) -> Float[Tensor, "b h w"]:
        """A few pixels too large or too small."""
        draws = self.random.uniform(batch, "mask").tolist()
        sizes = [round((2 * draw - 1) * MASK_ERROR_PX) for draw in draws]
        masks = [
            grown(one, size) if size >= 0 else ~grown(~one, -size)
            for one, size in zip(batch.masks.split(1), sizes, strict=True)
        ]
        return torch.cat(masks).float()


def grown(masks: Bool[Tensor, "b h w"], margin_px: int) -> Bool[Tensor, "b h w"]:
    """Masks with a margin around them."""
    side = 2 * margin_px + 1
    return max_pool2d(masks[:, None].float(), side, 1, margin_px)[:, 0] > 0


def _rgb(images: Tensor) -> Float[Tensor, "b 3 h w"]:
    return unit_rgb(images).movedim(-1, 1)
