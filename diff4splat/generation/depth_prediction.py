"""Depth of one image: the depth prior at several scales, mirrored too, and averaged.

Axes: ``h w`` pixels of the copy that the networks see. One pass of the network shows the errors of
its grid and its side; those of several passes differ and cancel (multi-scale test-time
augmentation). Scales have no common unit: each map is brought to the median of the first. A
photograph mirrored then has the mirrored depth. An image that the network sees whole, at the size
that it was trained for, gains from its mirror image alone: other scales cost 0.1 dB on worlds.
"""

from collections.abc import Iterator, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks.resize import nearest_multiple
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.protocols import DepthPrior

SCALES = (1.0, 0.75, 1.25)
"""Sides against those of the copy; the first gives the unit."""


def predict_depth(
    network: DepthPrior,
    rgb: Float[Tensor, "h w 3"],
    config: ActivationConfig,
    scales: Sequence[float] = SCALES,
) -> Float[Tensor, "h w"]:
    """Z of every pixel in scene units."""
    image = rgb.movedim(-1, 0)[None]
    maps = [_log_depth(network, scaled, config) for scaled in _scaled(image, scales)]
    maps = [_resized(one[None, None], rgb.shape[:2])[0, 0] for one in maps]
    unit = maps[0].median()
    return torch.stack([one - one.median() + unit for one in maps]).mean(0).exp()


def _log_depth(
    network: DepthPrior, image: Float[Tensor, "1 3 h w"], config: ActivationConfig
) -> Float[Tensor, "h w"]:
    """The mean of the image's and its mirror image's."""
    both = [network(image), network(image.flip(-1)).flip(-1)]
    return torch.stack([key_depth(raw[:, 0], config)[0].log() for raw in both]).mean(0)


def _scaled(
    image: Float[Tensor, "1 3 h w"], scales: Sequence[float]
) -> Iterator[Float[Tensor, "1 3 h2 w2"]]:
    """The image at every scale whose sides differ from those before."""
    sizes = [
        tuple(nearest_multiple(side * scale, BACKBONE_MULTIPLE_PX) for side in image.shape[2:])
        for scale in scales
    ]
    for size in dict.fromkeys(sizes):
        yield _resized(image, size)


def _resized(maps: Float[Tensor, "1 c h w"], size: tuple[int, ...]) -> Float[Tensor, "1 c h2 w2"]:
    if tuple(maps.shape[2:]) == tuple(size):
        return maps
    return torch.nn.functional.interpolate(
        maps, tuple(size), mode="bilinear", align_corners=False, antialias=True
    )
