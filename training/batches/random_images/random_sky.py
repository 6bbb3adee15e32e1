"""Skies that the worlds do not have: night, dusk, overcast.

Axes: ``n`` images, ``h w`` pixels. Where an image has depth somewhere and none here, here is sky.
Some get a gradient between two colours in its place, with a bit of its own clouds; some of these
are dark, down to black.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

SKY_DRAWS = 9
"""Random numbers per image: other sky, clouds, colour above, colour below, brightness."""
SKY_SHARE = 0.4
"""Share of images with another sky."""
DARK_SHARE = 0.4
"""Share of other skies that are darker than their colours; by chance hardly any would be dark."""


def random_sky(
    rgb: Float[Tensor, "n 3 h w"], known: Bool[Tensor, "n h w"], draws: Float[Tensor, "n 9"]
) -> Float[Tensor, "n 3 h w"]:
    """Images with other skies; ``draws`` are uniform in [0, 1)."""
    sky = ~known & known.flatten(1).any(1)[:, None, None]
    sky = sky & (draws[:, 0, None, None] < SKY_SHARE)
    above, below = draws[:, 2:5], draws[:, 5:8]
    down = torch.linspace(0, 1, rgb.shape[2]).to(rgb)[:, None]
    gradient = above[:, :, None, None] * (1 - down) + below[:, :, None, None] * down
    gradient = gradient * (draws[:, 8, None, None, None] / DARK_SHARE).clamp_max(1)
    clouds = rgb - _mean_over(rgb, sky)
    other = (gradient + draws[:, 1, None, None, None] * clouds).clamp(0, 1)
    return torch.where(sky[:, None], other, rgb)


def _mean_over(
    rgb: Float[Tensor, "n 3 h w"], mask: Bool[Tensor, "n h w"]
) -> Float[Tensor, "n 3 1 1"]:
    """Mean colour of the masked pixels; 0 where there are none."""
    weight = mask[:, None].to(rgb)
    total = (rgb * weight).sum((2, 3), keepdim=True)
    return total / weight.sum((2, 3), keepdim=True).clamp_min(1)
