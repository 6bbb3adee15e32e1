"""A bundled network on another backbone, without training: what joins them is fitted.

Axes: ``n`` images, ``h w`` pixels, ``c`` channels. All other layers are taken as they are. The
convolutions beside the backbone are fitted by least squares, so that the decoder is given what it
was trained on.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.training.backbone_init import fill_backbone

RIDGE = 1e-3
"""Of the mean variance of a channel."""


def start_from(
    network: BackboneUNet, larger: BackboneUNet, images: Float[Tensor, "n 3 h w"]
) -> list[float]:
    """Give ``larger`` the weights of ``network`` on a public backbone.

    Returns the share of the variance that every level misses, finest first.

    Raises:
        InputError: the package with the weights is not installed.
    """
    kept = {name: value for name, value in network.state_dict().items() if _is_kept(name)}
    larger.load_state_dict(kept, strict=False)
    fill_backbone(larger)
    with torch.no_grad():
        pairs = zip(network.lateral, network.backbone(images), strict=True)
        wanted = [conv(level) for conv, level in pairs]
        levels = zip(larger.lateral, larger.backbone(images), wanted, strict=True)
        return [fit(conv, level, want) for conv, level, want in levels]


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
