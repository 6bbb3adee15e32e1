"""Free sentences are read as plain ones of the same meaning.

Axes: ``n`` pairs of sentences, ``b`` samples, ``r`` numbers of a reading.

    sentence ─ text encoder ─ text adapter ─┬ mean ─ condition ───────────┬ readings
                                            └ attention, random features ─┘

    plain sentence ─ readings (no gradient) ─┐
    free sentence ── readings ───────────────┴ difference

Sides are read from the text alone, so no image is needed: one step sees many more sentences than
images. The condition alone is not enough: with it "to the back" still moved objects forward.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.training.batches.requests.sentence_pairs import draw_sentence_pair
from diff4splat.training.stages.text_conditioning import TextConditioning

PAIRS = 8
"""Pairs of sentences per sample."""


def paraphrase_error(
    network: nn.Module,
    text: TextConditioning,
    generators: list[torch.Generator],
    features: torch.Generator,
) -> Float[Tensor, " b"]:
    """Squared difference of the readings, over the variance among the plain sentences' own.

    ``generators`` draw the sentences of every sample, ``features`` those that read them.
    """
    pairs = [draw_sentence_pair(own) for own in generators for _ in range(PAIRS)]
    device, start = next(network.parameters()).device, features.get_state()

    def readings(captions: list[str]) -> list[Tensor]:
        features.set_state(start)
        return network.text_readings(*text.encode_captions(captions, device), features)

    with torch.no_grad():
        plain = readings([pair.plain for pair in pairs])
    free = readings([pair.free for pair in pairs])
    return torch.stack([_relative(*both) for both in zip(free, plain, strict=True)]).mean(0)


def _relative(free: Float[Tensor, "n r"], plain: Float[Tensor, "n r"]) -> Float[Tensor, " b"]:
    error = (free - plain).square().mean(1).unflatten(0, (-1, PAIRS)).mean(1)
    variance = plain.unflatten(0, (-1, PAIRS)).var(1).mean(1)
    return error / variance.clamp_min(1e-6)
