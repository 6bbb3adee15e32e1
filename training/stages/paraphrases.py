"""Free sentences are read as plain ones of the same meaning.

Axes: ``n`` pairs of sentences, ``b`` samples, ``d`` width of the condition.

    plain sentence ─ text encoder ─ text adapter ─ mean ─ condition (no gradient) ─┐
    free sentence ── text encoder ─ the same adapter ─── condition ────────────────┴ difference

Sides are read from the text alone, so no image is needed: one step sees many more sentences than
images.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.training.batches.requests.sentence_pairs import draw_sentence_pair
from diff4splat.training.stages.text_conditioning import TextConditioning

PAIRS = 8
"""Pairs of sentences per sample."""


def paraphrase_error(
    network: nn.Module, text: TextConditioning, generators: list[torch.Generator]
) -> Float[Tensor, " b"]:
    """Squared difference of the conditions, over the variance among the plain sentences' own."""
    pairs = [draw_sentence_pair(own) for own in generators for _ in range(PAIRS)]
    device = next(network.parameters()).device
    with torch.no_grad():
        plain = network.text_condition(*text.encode_captions([p.plain for p in pairs], device))
    free = network.text_condition(*text.encode_captions([p.free for p in pairs], device))
    error = (free - plain).square().mean(1).unflatten(0, (-1, PAIRS)).mean(1)
    variance = plain.unflatten(0, (-1, PAIRS)).var(1).mean(1)
    return error / variance.clamp_min(1e-6)
