"""Depth of one image: the depth prior at several scales, mirrored too, and fused.

Axes: ``h w`` pixels of the copy that the networks see, ``e`` encoders. One pass of the network
shows the errors of its grid and its side; those of several passes differ and cancel (multi-scale
test-time augmentation). Scales have no common unit: the median is that of the first. A
photograph mirrored then has the mirrored depth. An image that the network sees whole, at the size
that it was trained for, gains from its mirror image alone: other scales cost 0.1 dB on worlds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth.fusion import fused, out_of_domain_score
from diff4splat.generation.depth.shrinkage import shrunk
from diff4splat.models.blocks.resize import nearest_multiple
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.protocols import DepthPrior

SCALES = (1.0, 0.75, 1.25)
"""Sides against those of the copy; the first gives the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedDepth:
    """Depth of an image, and what the prior knows about itself."""

    depth: Float[Tensor, "h w"]
    """Z in scene units."""
    uncertainty: Float[Tensor, "h w"] | None
    """Scale of the error of log depth, if the prior predicts it."""
    out_of_domain: Float[Tensor, ""]
    """0 for an image in the domain of training, to 1."""

    def record(self) -> dict[str, object]:
        """For the log of a run: numbers over the image."""
        record = {"source": "model", "out_of_domain": round(float(self.out_of_domain), 3)}
        if self.uncertainty is None:
            return record
        return record | {"median_uncertainty": round(float(self.uncertainty.median()), 3)}


def predict_depth(
    network: DepthPrior,
    rgb: Float[Tensor, "h w 3"],
    config: ActivationConfig,
    scales: Sequence[float] = SCALES,
) -> PredictedDepth:
    """The passes fused, and shrunk where they are unsure."""
    image = rgb.movedim(-1, 0)[None]
    passes = [_pass(network, one, config) for one in _scaled(image, scales)]
    maps = torch.cat([_resized(one, rgb.shape[:2]) for one, _ in passes])
    unit, score = maps[:2].mean((0, 1)).median(), out_of_domain_score(maps)
    log_depth = fused(maps, score)
    unsure = [_resized(one, rgb.shape[:2]) for _, one in passes if one is not None]
    uncertainty = torch.cat(unsure).exp().mean((0, 1)) if unsure else None
    if uncertainty is not None:
        log_depth = shrunk(log_depth, uncertainty, score, rgb)
    depth = (unit + log_depth).exp()
    return PredictedDepth(depth=depth, uncertainty=uncertainty, out_of_domain=score)


def _pass(
    network: DepthPrior, image: Float[Tensor, "1 3 h2 w2"], config: ActivationConfig
) -> tuple[Float[Tensor, "2 e h2 w2"], Float[Tensor, "2 1 h2 w2"] | None]:
    """Log depth by every encoder and log uncertainty, of the image and of its mirror image."""
    raw, log_scale = network.predict_distance_and_uncertainty(image)
    mirrored, other = network.predict_distance_and_uncertainty(image.flip(-1))
    log_depth = key_depth(torch.cat([raw, mirrored.flip(-1)]), config).log()
    if log_scale is None:
        return log_depth, None
    return log_depth, torch.cat([log_scale, other.flip(-1)])


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


def _resized(maps: Float[Tensor, "n c h w"], size: tuple[int, ...]) -> Float[Tensor, "n c h2 w2"]:
    if tuple(maps.shape[2:]) == tuple(size):
        return maps
    return torch.nn.functional.interpolate(
        maps, tuple(size), mode="bilinear", align_corners=False, antialias=True
    )
