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
    """3 − |v − s|² · scale of the seed, for every pixel and seed.

    One product of (v, |v|², 1) with weights of each seed: there may be 67 million pairs.
    """
    scales = log_scales.exp()[..., None]
    constant = INSIDE_LOGIT - scales * _squares(seeds)
    of_seeds = torch.cat([2 * scales * seeds, -scales, constant], -1)
    of_pixels = torch.cat([vectors, _squares(vectors), torch.ones_like(vectors[..., :1])], -1)
    return (of_pixels @ of_seeds.mT).clamp_(max=INSIDE_LOGIT)


def _squares(vectors: Float[Tensor, "*b c"]) -> Float[Tensor, "*b 1"]:
    return vectors.square().sum(-1, keepdim=True)
