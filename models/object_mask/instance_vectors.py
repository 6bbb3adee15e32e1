"""Which pixels belong to one object, whatever its name (ours, ADR 36).

Axes: ``b`` images, ``h w`` pixels, ``c`` channels, ``s`` seeds, ``p`` pixels of a flattened image.
Every pixel has a vector, and a scale. Pixels of one object have near vectors. The first two
channels are the pixel's place and an offset, so that two equal objects stay apart (spatial
embeddings, arXiv 1906.11109; here further channels come with them).

    seed, vectors ─ distance × scale of the seed ─ logit that a pixel belongs to the seed's object
"""

import torch
from jaxtyping import Float
from torch import Tensor

INSIDE_LOGIT = 3.0
"""Of the seed itself."""


def membership_logits(
    instances: Float[Tensor, "b k h w"], seeds: Float[Tensor, "b s p"]
) -> Float[Tensor, "b s h w"]:
    """Logit that a pixel belongs to the object of each seed.

    ``seeds`` are weights of pixels that sum to one: a seed is one pixel, or a mean of several.
    """
    maps = instances.flatten(2)
    means = torch.einsum("bsp,bkp->bsk", seeds, maps)
    logits = pair_logits(maps[:, :-1].mT, means[..., :-1], means[..., -1])
    return logits.mT.unflatten(-1, instances.shape[-2:])


def pair_logits(
    vectors: Float[Tensor, "*b p c"],
    seeds: Float[Tensor, "*b s c"],
    log_scales: Float[Tensor, "*b s"],
) -> Float[Tensor, "*b p s"]:
    """3 − |v − s|² · scale of the seed, for every pixel and seed."""
    squares = vectors.square().sum(-1)[..., None] + seeds.square().sum(-1)[..., None, :]
    distance = (squares - 2 * vectors @ seeds.mT).clamp_min(0)
    return INSIDE_LOGIT - distance * log_scales.exp()[..., None, :]
