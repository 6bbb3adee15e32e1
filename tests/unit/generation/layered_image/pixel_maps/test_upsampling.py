"""Depth and displacement of pixels from cells: against plain loops, at edges and extremes."""

import math

import pytest
import torch
from image_layers import FAR_RANGES, random_depth, random_rgb
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.upsampling import SAME_SURFACE, upsample_maps
from diff4splat.models.blocks.bilateral_upsampling import COLOR_SIGMA, DISTANCE_SIGMA

GRID, SIDE = (3, 5), 4
SIZE_PX = (GRID[0] * SIDE, GRID[1] * SIDE)


def oracle(
    depth: Tensor, displacement: Tensor, rgb: tuple[Tensor, Tensor]
) -> tuple[Tensor, Tensor]:
    """One pixel and one neighbour at a time."""
    small, full = rgb
    fine_depth = torch.zeros(SIZE_PX, dtype=torch.float64)
    fine = torch.zeros(len(displacement), *SIZE_PX, 3, dtype=torch.float64)
    for row in range(SIZE_PX[0]):
        for column in range(SIZE_PX[1]):
            candidates = []
            for down in (-1, 0, 1):
                for right in (-1, 0, 1):
                    i = min(max(row // SIDE + down, 0), GRID[0] - 1)
                    j = min(max(column // SIDE + right, 0), GRID[1] - 1)
                    y = down - ((row % SIDE + 0.5) / SIDE - 0.5)
                    x = right - ((column % SIDE + 0.5) / SIDE - 0.5)
                    unlike = float((small[i, j] - full[row, column]).square().sum())
                    weight = -(y * y + x * x) / (2 * DISTANCE_SIGMA**2) - unlike / (
                        2 * COLOR_SIGMA**2
                    )
                    candidates.append((weight, i, j))
            _, best_i, best_j = max(candidates)
            nearest = math.log(float(depth[best_i, best_j]))
            total = mean = 0.0
            for weight, i, j in candidates:
                step = math.log(float(depth[i, j])) - nearest
                if abs(step) <= SAME_SURFACE:
                    share = math.exp(weight - max(candidates)[0])
                    total, mean = total + share, mean + share * step
            farther = math.exp(mean / total)
            fine_depth[row, column] = math.exp(nearest) * farther
            fine[:, row, column] = displacement[:, best_i, best_j] * farther
    return fine_depth, fine


@pytest.mark.parametrize("limits", [(3.0, 3.5), (1.0, 20.0)])
def test_both_maps_against_plain_loops(limits: tuple[float, float]) -> None:
    rgb = (random_rgb(*GRID).double(), random_rgb(*SIZE_PX, seed=1).double())
    depth = random_depth(*GRID, limits).double()
    displacement = torch.randn(2, *GRID, 3, dtype=torch.float64)
    actual = upsample_maps(depth, displacement, rgb)
    for got, want in zip(actual, oracle(depth, displacement, rgb), strict=True):
        torch.testing.assert_close(got, want, atol=1e-12, rtol=1e-12)


@pytest.mark.parametrize("mixed_depth", [2.0, 4.0, 8.0])
def test_a_depth_edge_at_a_colour_edge_is_as_sharp_as_the_image(mixed_depth: float) -> None:
    full = torch.zeros(*SIZE_PX, 3)
    full[:, 10:] = 1.0
    small = full.unflatten(0, (GRID[0], SIDE)).unflatten(2, (GRID[1], SIDE)).mean((1, 3))
    depth = torch.full(GRID, 2.0)
    depth[:, 3:], depth[:, 2] = 8.0, mixed_depth
    fine, _ = upsample_maps(depth, None, (small, full))
    torch.testing.assert_close(fine, 2.0 + 6.0 * full[..., 0], atol=1e-4, rtol=0)


def test_one_surface_is_continuous_between_cells() -> None:
    rgb = (torch.full((*GRID, 3), 0.5), torch.full((*SIZE_PX, 3), 0.5))
    depth = (4.0 * torch.exp(0.5 * SAME_SURFACE * torch.arange(GRID[1]))).expand(GRID)
    fine, _ = upsample_maps(depth, None, rgb)
    torch.testing.assert_close(fine, fine[:1].expand(SIZE_PX), atol=1e-4, rtol=0)
    steps = fine[0, SIDE:-SIDE].log().diff()
    assert float(steps.min()) > 0, "depth rises with every pixel, not with every cell"
    assert float(steps.max()) < 0.25 * SAME_SURFACE


def test_cells_of_another_surface_do_not_count_whatever_their_colour() -> None:
    rgb = (torch.full((*GRID, 3), 0.5), torch.full((*SIZE_PX, 3), 0.5))
    depth = 2.0 * torch.exp(torch.arange(15.0) * math.log(1.2)).view(GRID)
    fine, _ = upsample_maps(depth, None, rgb)
    cells = depth.repeat_interleave(SIDE, 0).repeat_interleave(SIDE, 1)
    torch.testing.assert_close(fine, cells, rtol=1e-5, atol=0)


def test_displacement_stops_at_a_colour_edge() -> None:
    full = torch.zeros(*SIZE_PX, 3)
    full[:, 10:] = 1.0
    small = full.unflatten(0, (GRID[0], SIDE)).unflatten(2, (GRID[1], SIDE)).mean((1, 3))
    displacement = torch.zeros(2, *GRID, 3)
    displacement[1, :, 3:] = torch.tensor([1.0, 2.0, 3.0])
    _, fine = upsample_maps(torch.full(GRID, 4.0), displacement, (small, full))
    assert not fine[0].any() and not fine[:, :, :10].any()
    torch.testing.assert_close(fine[1, :, 12:], displacement[1, :1, 3:4].expand(12, 8, 3))


def test_at_one_size_both_maps_are_themselves() -> None:
    rgb, depth = random_rgb(*GRID), random_depth(*GRID, (1.0, 9.0))
    displacement = torch.randn(2, *GRID, 3)
    fine = upsample_maps(depth, displacement, (rgb, rgb))
    assert fine[0] is depth and fine[1] is displacement


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("grid", [GRID, (1, 5), (1, 1)])
def test_any_depth_is_finite_and_within_its_cells(
    limits: tuple[float, float], grid: tuple[int, int]
) -> None:
    rgb = (random_rgb(*grid), random_rgb(grid[0] * SIDE, grid[1] * SIDE, seed=1))
    depth, displacement = random_depth(*grid, limits), torch.randn(3, *grid, 3)
    fine_depth, fine = upsample_maps(depth, displacement, rgb)
    assert fine_depth.shape == rgb[1].shape[:2] and fine.shape == (3, *rgb[1].shape)
    assert bool(fine_depth.isfinite().all()) and bool(fine.isfinite().all())
    slack = 1 + 1e-3
    assert bool((fine_depth >= depth.min() / slack).all())
    assert bool((fine_depth <= depth.max() * slack).all())


def test_a_constant_depth_stays_constant() -> None:
    rgb = (random_rgb(*GRID), random_rgb(*SIZE_PX, seed=1))
    fine, _ = upsample_maps(torch.full(GRID, 7.0), None, rgb)
    torch.testing.assert_close(fine, torch.full(SIZE_PX, 7.0))
