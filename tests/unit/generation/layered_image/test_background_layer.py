"""The layer behind the pixels of an image."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from image_layers import FAR_RANGES, FOCAL_PX, is_finite, random_depth, random_rgb
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import (
    BEHIND,
    COLOR_SIGMA_PX,
    FOOTPRINT_PX,
    SAME_SURFACE,
    WINDOW,
    background_layer,
    farther_than_pixels,
)
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.geometry.camera import pinhole
from diff4splat.render.api import render

SIDE, REACH = 16, WINDOW // 2


def behind(rgb: Tensor, depth: Tensor, displacement: Tensor | None = None) -> ImageLayer:
    camera = pinhole(FOCAL_PX, (depth.shape[0], depth.shape[1])).to(depth.dtype)
    return background_layer(rgb, depth, camera, displacement)


def halves() -> tuple[Tensor, Tensor]:
    """Red and near on the left, blue and far on the right."""
    depth = torch.full((SIDE, SIDE), 8.0)
    depth[:, : SIDE // 2] = 2.0
    rgb = torch.zeros(SIDE, SIDE, 3)
    rgb[..., 2] = 1.0
    rgb[:, : SIDE // 2] = torch.tensor([1.0, 0.0, 0.0])
    return rgb, depth


def oracle(rgb: Tensor, depth: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Colour, depth and whether the pixel lies on the far side, one pixel at a time."""
    height, width = depth.shape
    color, far = torch.zeros_like(rgb), torch.zeros_like(depth)
    holds = torch.zeros(height, width, dtype=torch.bool)
    for row in range(height):
        for column in range(width):
            near = []
            for down in range(-REACH, REACH + 1):
                for right in range(-REACH, REACH + 1):
                    i = min(max(row + down, 0), height - 1)
                    j = min(max(column + right, 0), width - 1)
                    near.append((depth[i, j], rgb[i, j], down * down + right * right))
            far[row, column] = max(z for z, _, _ in near)
            holds[row, column] = (far[row, column] / depth[row, column]).log() < SAME_SURFACE
            total, mean = 0.0, torch.zeros(3, dtype=rgb.dtype)
            for z, value, squared in near:
                if (far[row, column] / z).log() < SAME_SURFACE:
                    share = torch.exp(torch.tensor(-squared / (2 * COLOR_SIGMA_PX**2)).double())
                    total, mean = total + share, mean + share * value
            color[row, column] = rgb[row, column] if holds[row, column] else mean / total
    return color, far, holds


def test_it_agrees_with_plain_loops() -> None:
    rgb, depth = random_rgb(6, 8).double(), random_depth(6, 8, (1.0, 2.0)).double()
    layer, (color, far, holds) = behind(rgb, depth), oracle(rgb, depth)
    torch.testing.assert_close(layer.rgb, color)
    torch.testing.assert_close(layer.depth, BEHIND * far)
    pixels = torch.arange(48).view(6, 8)
    assert torch.equal(layer.pixel_index, torch.where(holds, pixels, NO_PIXEL))
    assert bool(holds.any()) and not bool(holds.all())


def test_on_one_surface_it_has_the_colours_of_its_pixels() -> None:
    rgb = random_rgb(SIDE, SIDE)
    layer = behind(rgb, torch.full((SIDE, SIDE), 3.0))
    assert torch.equal(layer.rgb, rgb)
    torch.testing.assert_close(layer.depth, torch.full((SIDE, SIDE), 3.0 * BEHIND))
    assert layer.pixel_index.flatten().tolist() == list(range(SIDE * SIDE))
    assert bool(layer.mask.all()) and not layer.in_image
    scales = layer_gaussians(layer).scales
    torch.testing.assert_close(
        scales, torch.full_like(scales, FOOTPRINT_PX * 3 * BEHIND / FOCAL_PX)
    )


def test_in_front_of_an_edge_it_belongs_to_the_far_side_and_is_static() -> None:
    rgb, depth = halves()
    layer = behind(rgb, depth, torch.ones(2, SIDE, SIDE, 3))
    edge = SIDE // 2
    near, far = layer.depth[:, : edge - REACH], layer.depth[:, edge - REACH :]
    torch.testing.assert_close(near, torch.full_like(near, 2.0 * BEHIND))
    torch.testing.assert_close(far, torch.full_like(far, 8.0 * BEHIND))
    blue = torch.tensor([0.0, 0.0, 1.0]).expand(SIDE, SIDE - edge + REACH, 3)
    torch.testing.assert_close(layer.rgb[:, edge - REACH :], blue, atol=1e-6, rtol=0)
    other = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    other[:, edge - REACH : edge] = True
    assert torch.equal(layer.pixel_index == NO_PIXEL, other)
    assert not layer.displacement[:, other].any() and bool(
        (layer.displacement[:, ~other] == 1).all()
    )


def test_it_lies_behind_all_pixels_near_it() -> None:
    depth = random_depth(SIDE, SIDE, (1.0, 20.0))
    layer = behind(random_rgb(SIDE, SIDE), depth)
    farthest = torch.nn.functional.max_pool2d(depth[None], WINDOW, 1, REACH)[0]
    assert bool((layer.depth > farthest).all())


def test_a_slanted_floor_is_one_surface() -> None:
    rows = torch.arange(SIDE) + 0.5
    depth = (20 / (rows + 30)).view(-1, 1).expand(SIDE, SIDE).contiguous()
    assert bool((behind(random_rgb(SIDE, SIDE), depth).pixel_index != NO_PIXEL).all())


@given(st.sampled_from(FAR_RANGES), st.integers(0, 5), st.integers(1, 9), st.integers(1, 9))
def test_any_depth_and_size_is_finite(
    limits: tuple[float, float], seed: int, height: int, width: int
) -> None:
    depth = random_depth(height, width, limits, seed)
    layer = behind(random_rgb(height, width), depth, torch.randn(2, height, width, 3))
    assert is_finite(layer) and float(layer.rgb.min()) >= 0 and float(layer.rgb.max()) <= 1 + 1e-6


def test_it_shows_no_black_where_small_pixels_part() -> None:
    layer = behind(torch.full((SIDE, SIDE, 3), 0.8), torch.full((SIDE, SIDE), 4.0))
    inner = render(layer_gaussians(layer), layer.camera).rgb[3:-3, 3:-3]
    torch.testing.assert_close(inner, torch.full_like(inner, 0.8), atol=0.01, rtol=0)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_precision_is_that_of_the_depth(dtype: torch.dtype) -> None:
    rgb, depth = (part.to(dtype) for part in halves())
    layer = behind(rgb, depth)
    assert layer.depth.dtype == layer.rgb.dtype == dtype
    assert layer.displacement is None


def test_it_lies_behind_farther_pixels_in_its_neighbourhood() -> None:
    rgb, depth = halves()
    layer, farthest = behind(rgb, depth), random_depth(SIDE, SIDE, (0.5, 20.0), seed=3)
    moved = farther_than_pixels(layer, farthest)
    for row in range(SIDE):
        for column in range(SIDE):
            rows, columns = (slice(max(at - REACH, 0), at + REACH + 1) for at in (row, column))
            near = BEHIND * float(farthest[rows, columns].max())
            wanted = max(float(layer.depth[row, column]), near)
            assert float(moved.depth[row, column]) == pytest.approx(wanted, rel=1e-6)


def test_nearer_pixels_change_nothing() -> None:
    layer = behind(*halves())
    assert torch.equal(farther_than_pixels(layer, torch.full((SIDE, SIDE), 0.1)).depth, layer.depth)
