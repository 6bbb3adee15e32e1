"""Free sentences give the motion that plain ones of the same meaning give.

Axes: ``n`` pairs of sentences, ``b`` samples, ``h w`` pixels, ``t hc wc`` latent frames and cells.

    part of an image ─────────────────────┐
    noise ────────────────────────────────┤
    plain sentence ─ text encoder ────────┴─ motion network ─ motion (no gradient) ─┐
    free sentence ── text encoder ── the same network on the same part and noise ───┴ difference

Sides are read from the text alone, so a small part of an image is enough: one step sees many more
sentences than images.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.training.batches.requests.sentence_pairs import draw_sentence_pair
from diff4splat.training.stages.text_conditioning import TextConditioning

PAIRS = 8
"""Pairs of sentences per sample."""
PART_PX = 32
"""Side of the part of an image that a pair is read for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParaphraseInputs:
    """What the network sees beside the text."""

    images: Float[Tensor, "n 3 h w"]
    noise: Float[Tensor, "n 3 t hc wc"]


def paraphrase_error(
    network: nn.Module,
    text: TextConditioning,
    images: Float[Tensor, "b 3 h w"],
    generators: list[torch.Generator],
) -> Float[Tensor, " b"]:
    """Squared difference of both motions, in the units of the flow's error at level 1."""
    pairs = [draw_sentence_pair(own) for own in generators for _ in range(PAIRS)]
    inputs = _parts(images, generators)
    with torch.no_grad():
        plain = _motion(network, text, inputs, [pair.plain for pair in pairs])
    free = _motion(network, text, inputs, [pair.free for pair in pairs])
    return (free - plain).square().flatten(1).mean(1).unflatten(0, (-1, PAIRS)).mean(1)


def _motion(
    network: nn.Module, text: TextConditioning, inputs: ParaphraseInputs, sentences: list[str]
) -> Float[Tensor, "n 3 t hc wc"]:
    states, mask = text.encode_captions(sentences, inputs.images.device)
    level = inputs.noise.new_ones(len(sentences))
    return network(inputs.images, inputs.noise, level, states, mask)


def _parts(images: Float[Tensor, "b 3 h w"], generators: list[torch.Generator]) -> ParaphraseInputs:
    """A random part of the image for each pair, and noise in place of motion."""
    side = min(PART_PX, *images.shape[2:])
    parts, noise = [], []
    for image, own in zip(images, generators, strict=True):
        for _ in range(PAIRS):
            top, left = (
                int(torch.randint(length - side + 1, (), generator=own))
                for length in image.shape[1:]
            )
            parts.append(image[:, top : top + side, left : left + side])
            noise.append(torch.randn(3, 1, side // CELL_PX, side // CELL_PX, generator=own))
    return ParaphraseInputs(images=torch.stack(parts), noise=torch.stack(noise).to(images))
