"""Images that are no photographs, drawn by formulas."""

from collections.abc import Callable, Mapping

import torch
from jaxtyping import Float
from torch import Tensor

SIDE_PX = 96
Image = Float[Tensor, "h w 3"]


def drawn_images() -> Mapping[str, Callable[[], Image]]:
    """Name → image in [0, 1]."""
    return {
        "two objects": objects,
        "constant": lambda: torch.full((SIDE_PX, SIDE_PX, 3), 0.5),
        "black": lambda: torch.zeros(SIDE_PX, SIDE_PX, 3),
        "white": lambda: torch.ones(SIDE_PX, SIDE_PX, 3),
        "noise": lambda: torch.rand(SIDE_PX, SIDE_PX, 3),
        "1:8": lambda: objects(SIDE_PX // 3, 8 * SIDE_PX // 3),
        "8:1": lambda: objects(8 * SIDE_PX // 3, SIDE_PX // 3),
        "1:40": lambda: objects(16, 640),
        "one pixel": lambda: torch.full((1, 1, 3), 0.5),
        "checkerboard of pixels": checkerboard,
        "saturated stripes": stripes,
        "line drawing": line_drawing,
        "one bright pixel": bright_pixel,
    }


def objects(height: int = SIDE_PX, width: int = SIDE_PX) -> Image:
    """A red block and a blue ball on green ground under a sky."""
    y, x = _grid(height, width)
    image = torch.stack([0.5 + 0.2 * y, 0.65 + 0.1 * y, 0.9 - 0.2 * y], -1)
    ground = torch.tensor([0.25, 0.5, 0.2]) * (1.4 - 0.4 * y)[..., None]
    image = torch.where((y > 0.55)[..., None], ground, image)
    block = (x - 0.3).abs().maximum((y - 0.6).abs()) < 0.13
    ball = (x - 0.7).square() + (y - 0.65).square() < 0.12**2
    image[block] = torch.tensor([0.85, 0.12, 0.1])
    image[ball] = torch.tensor([0.1, 0.2, 0.8])
    return image


def checkerboard() -> Image:
    """Black and white alternate from pixel to pixel, as high a frequency as there is."""
    index = torch.arange(SIDE_PX)
    return ((index[:, None] + index) % 2).float()[..., None].expand(-1, -1, 3).clone()


def stripes() -> Image:
    """Pure red, green and blue columns."""
    return torch.eye(3)[(torch.arange(SIDE_PX) // 8) % 3].expand(SIDE_PX, -1, -1).clone()


def line_drawing() -> Image:
    """Thin black circles on white paper."""
    y, x = _grid(SIDE_PX, SIDE_PX)
    radius = torch.hypot(x - 0.5, y - 0.5)
    return (((radius * 12) % 1) > 0.15).float()[..., None].expand(-1, -1, 3).clone()


def bright_pixel() -> Image:
    """White in the middle of black."""
    image = torch.zeros(SIDE_PX, SIDE_PX, 3)
    image[SIDE_PX // 2, SIDE_PX // 2] = 1
    return image


def _grid(height: int, width: int) -> tuple[Float[Tensor, "h w"], Float[Tensor, "h w"]]:
    """Rows and columns from 0 to 1."""
    y, x = torch.linspace(0, 1, height), torch.linspace(0, 1, width)
    return y[:, None].expand(height, width), x.expand(height, width)
