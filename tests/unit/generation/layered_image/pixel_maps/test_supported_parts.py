"""A figure that carries a near part is as near; everything else stays as it is."""

import cv2
import numpy as np
import pytest
import torch
from image_layers import FAR_RANGES, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.supported_parts import with_support

SIDE = 96
NEAR, FAR = 2.0, 6.0
SKY, SKIN, COAT, LAWN = (0.4, 0.6, 0.9), (0.9, 0.7, 0.6), (0.1, 0.1, 0.2), (0.2, 0.5, 0.1)
PALE_SKY = (0.5, 0.7, 0.9)


def grid() -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.mgrid[:SIDE, :SIDE])


def head() -> np.ndarray:
    y, x = grid()
    return ((y - 30) / 18) ** 2 + ((x - 48) / 13) ** 2 < 1


def body() -> np.ndarray:
    """Neck and sloping shoulders."""
    y, x = grid()
    return (y > 44) & (np.abs(x - 48) < 5 + np.clip(2.0 * (y - 50), 0, 36))


def hollow() -> np.ndarray:
    """A quarter of the head."""
    y, x = grid()
    return (y > 30) & (x > 48)


def tree() -> np.ndarray:
    y, x = grid()
    return (y > 20) & (abs(x - 48) < 6)


def ground() -> np.ndarray:
    return grid()[0] > 46


def image(*layers: tuple[np.ndarray, tuple[float, float, float]]) -> Tensor:
    """Later layers cover earlier ones; a little noise, as cameras have it."""
    rgb = np.tile(np.array(SKY), (SIDE, SIDE, 1))
    for mask, color in layers:
        rgb[mask] = color
    noise = np.random.default_rng(0).normal(0, 0.01, rgb.shape)
    return torch.from_numpy(np.clip(rgb + noise, 0, 1)).float()


def depth_of(near: np.ndarray, nearest: float = NEAR) -> Tensor:
    return torch.from_numpy(np.where(near, nearest, FAR)).float()


def lid() -> np.ndarray:
    y, x = grid()
    return ((y - 34) / 18) ** 2 + ((x - 48) / 28) ** 2 < 1


def pebbles() -> Tensor:
    """A lid before stones of all colours, which a figure of colours has no outline in."""
    rgb = np.random.default_rng(2).random((SIDE // 2, SIDE // 2, 3))
    rgb = rgb.repeat(2, 0).repeat(2, 1)
    rgb[lid()] = SKIN
    return torch.from_numpy(rgb).float()


def portrait() -> Tensor:
    """Before a flag of the coat's colour; with a badge of the sky's."""
    y, x = grid()
    flag, badge = (x < 34) & (y < 48), (abs(x - 72) < 8) & (abs(y - 80) < 5)
    return image((flag, COAT), (body(), COAT), (badge, SKY), (head(), SKIN))


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_body_is_as_near_as_its_head(mirrored: bool) -> None:
    depth, rgb = depth_of(head()), portrait()
    if mirrored:
        depth, rgb = depth.flip(1), rgb.flip(1)
    found = with_support(depth, rgb)
    found = found.flip(1) if mirrored else found
    figure = torch.from_numpy(body() | head())
    assert float((found[figure] == NEAR).double().mean()) > 0.97
    assert float((found[~figure] == FAR).double().mean()) > 0.97


def test_relief_of_the_head_stays() -> None:
    depth = depth_of(head())
    nose = torch.from_numpy(head()) & (torch.arange(SIDE) == 48)
    depth[nose] = 1.5
    assert bool((with_support(depth, portrait())[nose] == 1.5).all())


@pytest.mark.parametrize(
    ("depth", "rgb"),
    [
        (depth_of(head()), image((ground(), LAWN), (head(), SKIN))),  # Before a horizon
        (depth_of(head()), image((head(), SKIN))),  # Before one wall
        (depth_of(lid()), pebbles()),
        (depth_of(head(), FAR / 1.3), portrait()),  # Hardly nearer
        (depth_of(head() | body()), portrait()),  # The body is near already
        (depth_of(tree()), image((tree(), COAT))),  # Reaches the bottom
        (depth_of(head()).roll(-13, 0), portrait().roll(-13, 0)),  # Hangs from above the image
        (depth_of(head()).roll(36, 1), portrait().roll(36, 1)),  # At the right edge
        (depth_of(head()).roll(-36, 1), portrait().roll(-36, 1)),
        (depth_of(head()), image((body(), PALE_SKY), (head(), SKIN))),  # No edge of colour
        (depth_of(head() & (grid()[0] < 15)), portrait()),  # Small
        (depth_of(head() & ~hollow()), portrait()),  # Not convex
        (torch.full((SIDE, SIDE), NEAR), portrait()),
        (depth_of(head()), torch.zeros(SIDE, SIDE, 3)),
    ],
)
def test_everything_else_stays(depth: Tensor, rgb: Tensor) -> None:
    assert torch.equal(with_support(depth, rgb), depth)


def test_equal_images_give_equal_bits() -> None:
    depth = depth_of(head())
    rgb = portrait() + 0.2 * torch.randn(SIDE, SIDE, 3)
    found = []
    for seed in range(8):
        cv2.setRNGSeed(seed)
        cv2.setNumThreads(1 + seed % 2)
        found.append(with_support(depth, rgb))
    cv2.setNumThreads(-1)
    assert all(torch.equal(one, found[0]) for one in found)


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (33, 20)])
def test_any_depth_stays_finite_and_comes_no_farther(
    limits: tuple[float, float], size: tuple[int, int]
) -> None:
    depth = random_depth(*size, limits)
    found = with_support(depth, torch.rand(*size, 3))
    assert bool(found.isfinite().all()) and bool((found > 0).all())
    assert bool((found <= depth * (1 + 1e-6)).all())
