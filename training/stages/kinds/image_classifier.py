"""The correction that an image classifier makes to the object mask; both stay as they are.

    images, captions ─ object mask ─ logits ──────┐
    nouns of captions ─ classes ──────────────────┼ image classifier ─ corrected logits
    images ───────────────────────────────────────┘

The layers that learn are few, and none sees its neighbours.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.image_classes.class_nouns import class_rows
from diff4splat.captions.image_classes.prompt_classes import prompt_classes
from diff4splat.models.networks import Networks
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.losses.object_mask import absent_error, cross_entropy, dice_error
from diff4splat.training.stages.kinds.object_mask import ObjectMaskStage
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import StagePlan, Terms


class ImageClassifierStage(ObjectMaskStage):
    """The last layers of the image classifier alone."""

    parts = ("text_encoder", "object_mask", "image_classifier")

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.image_classifier.to(memory_format=torch.channels_last)

    def forward(self, batch: RequestBatch) -> Terms:
        """The terms ``cross_entropy``, ``dice`` and ``absent``.

        All are 0 for images whose requests do not count.
        """
        losses, counts = self.plan.recipe.losses, batch.has_requests
        logits = self._logits(self._random_light(self._random_sharpness(batch), batch), batch)
        errors = {"cross_entropy": cross_entropy, "dice": dice_error, "absent": absent_error}
        return weighted_sum(
            [
                LossTerm(
                    name=name,
                    weight=getattr(losses, name),
                    compute=lambda error=error: error(logits, batch.masks) * counts,
                )
                for name, error in errors.items()
            ]
        )

    def _logits(
        self, rgb: Float[Tensor, "b 3 h w"], batch: RequestBatch
    ) -> Float[Tensor, "b r h w"]:
        with torch.no_grad():
            logits = super()._logits(rgb, batch)
        classes = class_rows([prompt_classes(text) for text in batch.captions])
        rows = classes.unflatten(0, logits.shape[:2]).to(logits.device)
        # One image after the other stays in the processor's cache: three times as fast.
        inputs = zip(rgb.split(1), logits.split(1), rows.split(1), strict=True)
        return torch.cat([self.image_classifier(*one) for one in inputs])
