"""One depth map from those of several passes and encoders (ours, ADR 39).

Axes: ``p`` passes, ``e`` encoders, ``h w`` pixels of log depth. On images in the domain of training
both encoders say the same, and their plain mean is best. On others they differ. Then the image
backbone is more often right, and the mean of maps that differ is flatter than each of them: it gets
their spread back.
"""

import torch
from jaxtyping import Float
from torch import Tensor

IN_DOMAIN, OUT_OF_DOMAIN = 0.8, 1.2
"""Disagreement of the encoders up to which an image is in the domain of training, and from which on
it is out of it."""
BACKBONE_SHARE = 0.65
"""Of the first encoder in the mean on an image out of domain; a half on one in domain."""
NEAR_RELIEF = 1.3
"""Out of domain, of what is nearer than the median: near objects are few pixels, which a map misses
as a whole, and the mean with it. Relief beyond the median needs none."""
MOST_STRETCH = 2.0
"""Maps that contradict each other have no spread to give back."""


def fused(maps: Float[Tensor, "p e h w"], out_of_domain: Float[Tensor, ""]) -> Float[Tensor, "h w"]:
    """The mean of the maps with their own spread, and with median 0."""
    share = _encoder_shares(maps, out_of_domain)[:, None, None]
    mean = (share * maps).sum(1).mean(0)
    spread = (share * _spread(maps)).sum(1).mean()
    relief = (mean - _median(mean)) * _stretch(spread, _spread(mean))
    return torch.where(relief < 0, relief * (1 + (NEAR_RELIEF - 1) * out_of_domain), relief)


def out_of_domain_score(maps: Float[Tensor, "p e h w"]) -> Float[Tensor, ""]:
    """0 for an image in the domain of training, 1 for one out of it; 0 with one encoder.

    Two encoders disagree by their mean difference over the mean spread of their maps.
    """
    if maps.shape[1] != 2:
        return maps.new_zeros(())
    maps = maps - _median(maps)
    difference = (maps[:, 0] - maps[:, 1]).abs().mean()
    disagreement = difference / _spread(maps).mean().clamp_min(torch.finfo(maps.dtype).tiny)
    return ((disagreement - IN_DOMAIN) / (OUT_OF_DOMAIN - IN_DOMAIN)).clamp(0, 1)


def _encoder_shares(
    maps: Float[Tensor, "p e h w"], out_of_domain: Float[Tensor, ""]
) -> Float[Tensor, " e"]:
    """Weights of the encoders: alike, or more of the first where two of them disagree."""
    shares = maps.new_full(maps.shape[1:2], 1 / maps.shape[1])
    shift = (BACKBONE_SHARE - 0.5) * out_of_domain
    return shares + torch.stack([shift, -shift]) if len(shares) == 2 else shares


def _stretch(wanted: Float[Tensor, ""], spread: Float[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """Factor that brings a ``spread`` to the ``wanted`` one, at most ``MOST_STRETCH``."""
    ratio = wanted / spread.clamp_min(torch.finfo(spread.dtype).tiny)
    return torch.where(spread > 0, ratio.clamp_max(MOST_STRETCH), 1.0)


def _spread(maps: Float[Tensor, "*b h w"]) -> Float[Tensor, "*b 1 1"]:
    """Mean absolute difference from the median."""
    return (maps - _median(maps)).abs().mean((-2, -1), keepdim=True)


def _median(maps: Float[Tensor, "*b h w"]) -> Float[Tensor, "*b 1 1"]:
    return maps.flatten(-2).median(-1).values[..., None, None]
