"""Captions for stages that read text: unchanged, paraphrased, or dropped.

Text is dropped for whole steps, so that guidance has its unconditional branch and every process
runs the same networks: processes with text would otherwise wait for those without.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from diff4splat.captions.paraphrase import paraphrase
from diff4splat.models.text_encoder.encoder import tokenize
from diff4splat.models.wan.umt5 import Umt5Encoder
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.stages.model_stage import StagePlan

VARIANTS = 2**31
GROUP = 32
"""Prompts that are encoded together."""
DEFAULT_CAPTION = "a scene"
"""Replaces missing captions, so that every process runs the text encoder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TextConditioning:
    """Encoded captions of one stage."""

    encoder: nn.Module
    plan: StagePlan

    def encode(
        self, batch: ClipBatch | LatentBatch | RequestBatch, training: bool
    ) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        """States of the captions, and the mask of real tokens."""
        captions = [caption or DEFAULT_CAPTION for caption in self._captions(batch, training)]
        return self.encode_captions(captions, batch.sample_index.device)

    def encode_captions(
        self, captions: list[str], device: torch.device
    ) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        """The same of any captions."""
        if isinstance(self.encoder, Umt5Encoder):
            return self.encoder.encode_prompts(captions)
        tokens, mask = tokenize(captions, self.plan.model.text.max_bytes)
        tokens, mask = tokens.to(device), mask.to(device)
        return self._by_length(tokens, mask), mask

    def _by_length(
        self, tokens: Int[Tensor, "b s"], mask: Bool[Tensor, "b s"]
    ) -> Float[Tensor, "b s d"]:
        """Prompts of like lengths together: padding costs as much as text."""
        if len(tokens) <= GROUP:
            return self.encoder(tokens, mask)
        lengths, states = mask.sum(1), []
        order = lengths.argsort()
        for rows in order.split(GROUP):
            longest = int(lengths[rows].max())
            own = self.encoder(tokens[rows, :longest], mask[rows, :longest])
            states.append(torch.nn.functional.pad(own, (0, 0, 0, tokens.shape[1] - longest)))
        return torch.cat(states)[order.argsort()]

    def encode_or_drop(
        self, batch: ClipBatch | LatentBatch | RequestBatch, training: bool
    ) -> tuple[Float[Tensor, "b s d"] | None, Bool[Tensor, "b s"] | None]:
        """The same; None in steps without text, or the empty prompt for models that need one."""
        if not self.drop_text(batch, training):
            return self.encode(batch, training)
        if isinstance(self.encoder, Umt5Encoder):
            return self.encoder.encode_prompts([""] * len(batch.captions))
        return None, None

    def drop_text(self, batch: ClipBatch | LatentBatch | RequestBatch, training: bool) -> bool:
        """Whether this step trains without text."""
        draw = torch.rand((), generator=self.plan.random.per_step(batch, "text"))
        return training and bool(draw < self.plan.recipe.text_dropout)

    def _captions(self, batch: ClipBatch | LatentBatch | RequestBatch, training: bool) -> list[str]:
        if not (training and self.plan.recipe.augment_captions):
            return list(batch.captions)
        paraphrased = []
        generators = self.plan.random.per_sample(batch, "words")
        for caption, own in zip(batch.captions, generators, strict=True):
            draw, variant = (
                torch.rand((), generator=own),
                torch.randint(VARIANTS, (), generator=own),
            )
            paraphrased.append(paraphrase(caption, float(draw), int(variant)))
        return paraphrased
