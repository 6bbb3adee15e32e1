"""What stages that read captions share: captions as they stand or in other words, or dropped.

Whole steps go without text, so that guidance has its unconditional branch and every process runs
the same networks: single samples without text would leave some processes waiting for others.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.captions.paraphrase import paraphrase
from diff4splat.models.text_encoder.encoder import tokenize
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.stages.model_stage import ModelStage

UNSAID = "a scene"
"""What clips without a caption say, so that every process runs the text encoder alike."""


class TextConditionedStage(ModelStage):
    """A stage with a text encoder."""

    def text(
        self, batch: ClipBatch | LatentBatch
    ) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        """States of the captions, and which of them are real."""
        captions = [caption or UNSAID for caption in self._captions(batch)]
        tokens, mask = tokenize(captions, self.plan.model.text.max_bytes)
        device = batch.cameras.focal_px.device
        tokens, mask = tokens.to(device), mask.to(device)
        return self.text_encoder(tokens, mask), mask

    def drops_text(self, batch: ClipBatch | LatentBatch) -> bool:
        """Whether this step goes without text."""
        draw = torch.rand((), generator=self.draw_for_step(batch, "text"))
        return self.training and bool(draw < self.plan.recipe.text_dropout)

    def _captions(self, batch: ClipBatch | LatentBatch) -> list[str]:
        """As they stand, or as somebody else would put them."""
        if not (self.training and self.plan.recipe.vary_captions):
            return list(batch.captions)
        said = []
        for caption, own in zip(batch.captions, self.draw(batch, "words"), strict=True):
            draw, variant = torch.rand((), generator=own), torch.randint(12, (), generator=own)
            said.append(paraphrase(caption, float(draw), int(variant)))
        return said
