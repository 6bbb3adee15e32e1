"""Instance vectors (``instance_vectors``) from the features of an object mask.

Axes: ``b`` images, ``h w`` pixels, ``c`` channels, ``k`` channels of a vector and its log scale.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.image_unet.cells import FOLDED_PX

IMAGE_SIDE = 8.0
"""Length of the image's longer side in the space of vectors."""
LARGEST_LOG_SCALE = 6.0
START_DEVIATION = 0.05


class InstanceHead(nn.Module):
    """Vector and log scale of every pixel, from features of cells of two pixels."""

    def __init__(self, features: int, channels: int) -> None:
        """``channels`` of a vector, two or more."""
        super().__init__()
        self.conv = nn.Conv2d(features, (channels + 1) * FOLDED_PX**2, 1)
        nn.init.normal_(self.conv.weight, std=START_DEVIATION)
        nn.init.zeros_(self.conv.bias)

    def forward(self, features: Float[Tensor, "b c h2 w2"]) -> Float[Tensor, "b k h w"]:
        """Vectors, and the log scale as the last channel."""
        maps = torch.nn.functional.pixel_shuffle(self.conv(features).float(), FOLDED_PX)
        log_scale = maps[:, -1:].clamp(-LARGEST_LOG_SCALE, LARGEST_LOG_SCALE)
        return torch.cat([maps[:, :2] + _places(maps), maps[:, 2:-1], log_scale], 1)


def _places(maps: Float[Tensor, "b k h w"]) -> Float[Tensor, "2 h w"]:
    """X and y of the pixel centres from the middle of the image."""
    longer = torch.sym_max(maps.shape[-1], maps.shape[-2])
    y, x = (
        (2 * torch.arange(side, device=maps.device, dtype=maps.dtype) + 1 - side) / longer
        for side in maps.shape[-2:]
    )
    return torch.stack(torch.meshgrid(x, y, indexing="xy")) * (IMAGE_SIDE / 2)
