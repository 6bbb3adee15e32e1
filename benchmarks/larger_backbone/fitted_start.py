"""The bundled depth prior on another backbone, without training: what joins them is fitted.

Axes: ``n`` images, ``h w`` pixels, ``c`` channels. Decoder and U-Net are taken as they are. The
convolutions beside the backbone are fitted by least squares, so that the decoder is given what it
was trained on.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.networks import Networks
from diff4splat.training.backbone_init import start_from_public_backbones

RIDGE = 1e-3
"""Of the mean variance of a channel."""


def with_backbone(
    network: BackboneDepthNet, size: BackboneSize, images: Float[Tensor, "n 3 h w"]
) -> tuple[BackboneDepthNet, list[float]]:
    """The same network on public weights of ``size``, and the share that every level misses.

    Raises:
        InputError: the package with the weights is not installed.
    """
    width = network.head.in_channels
    other = BackboneDepthNet(width, size=size, uncertainty=network.uncertainty is not None)
    own = {name: value for name, value in network.state_dict().items() if _is_kept(name)}
    other.load_state_dict(own, strict=False)
    start_from_public_backbones(Networks(monocular_depth=other), ["monocular_depth"])
    with torch.no_grad():
        pairs = zip(network.lateral, network.backbone(images), strict=True)
        wanted = [conv(level) for conv, level in pairs]
        levels = zip(other.lateral, other.backbone(images), wanted, strict=True)
        return other, [fit(conv, level, want) for conv, level, want in levels]


def fit(
    conv: nn.Conv2d, features: Float[Tensor, "n c h w"], wanted: Float[Tensor, "n d h w"]
) -> float:
    """Set ``conv`` of one pixel to the least squares; returns the share of the variance left."""
    x, y = (value.movedim(1, -1).flatten(0, 2).double() for value in (features, wanted))
    x_mean, y_mean = x.mean(0), y.mean(0)
    x, y = x - x_mean, y - y_mean
    covariance = x.T @ x / len(x)
    covariance.diagonal().add_(RIDGE * covariance.diagonal().mean())
    solution = torch.linalg.solve(covariance, x.T @ y / len(x))
    conv.weight.copy_(solution.T[..., None, None])
    conv.bias.copy_(y_mean - x_mean @ solution)
    return float((x @ solution - y).square().mean() / y.square().mean())


def _is_kept(name: str) -> bool:
    return not name.startswith(("backbone.", "lateral."))
