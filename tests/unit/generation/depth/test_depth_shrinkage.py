"""Relief that is unsure comes nearer to what is around it within its colours, and only there."""

import math

import pytest
import torch

from diff4splat.generation.depth.shrinkage import (
    AROUND,
    COLOR_STEP,
    LEAST,
    THROUGH_EDGES,
    UNSURE,
    shrunk,
)

SIDE = 24
OUT, IN = torch.ones(()), torch.zeros(())
GREY = torch.full((SIDE, SIDE, 3), 0.5)


def block() -> tuple[torch.Tensor, torch.Tensor]:
    """A near block on a far ground, and that it is unsure."""
    log_depth, uncertainty = torch.ones(SIDE, SIDE), torch.full((SIDE, SIDE), 0.01)
    log_depth[10:14, 10:14], uncertainty[10:14, 10:14] = 0.0, 2.0
    return log_depth, uncertainty


def from_the_formula(
    log_depth: torch.Tensor, uncertainty: torch.Tensor, out_of_domain: float, rgb: torch.Tensor
) -> torch.Tensor:
    """By a dense matrix."""
    height, width = log_depth.shape
    weight = 1 / (uncertainty**2 + LEAST**2)
    weight = (weight / weight.mean()).flatten()
    matrix = torch.diag(weight)
    for row in range(height):
        for column in range(width):
            for other in ((row, column + 1), (row + 1, column)):
                if other[0] < height and other[1] < width:
                    apart = float((rgb[row, column] - rgb[other]).norm())
                    bond = (AROUND * min(height, width)) ** 2
                    bond *= math.exp(-apart / COLOR_STEP) + THROUGH_EDGES
                    i, j = row * width + column, other[0] * width + other[1]
                    matrix[i, i] += bond
                    matrix[j, j] += bond
                    matrix[i, j] -= bond
                    matrix[j, i] -= bond
    around = torch.linalg.solve(matrix, weight * log_depth.flatten()).view_as(log_depth)
    kept = 1 / (1 + out_of_domain * (uncertainty / UNSURE) ** 2)
    return around + kept * (log_depth - around)


@pytest.mark.parametrize("shape", [(9, 13), (1, 1), (3, 40)])
def test_a_shrunk_map_follows_from_the_formula(shape: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(1)
    log_depth = torch.randn(shape, generator=generator, dtype=torch.float64)
    uncertainty = torch.rand(shape, generator=generator, dtype=torch.float64)
    rgb = 0.2 * torch.rand((*shape, 3), generator=generator, dtype=torch.float64)
    for out_of_domain in (0.0, 0.4, 1.0):
        wanted = from_the_formula(log_depth, uncertainty, out_of_domain, rgb)
        score = torch.tensor(out_of_domain, dtype=torch.float64)
        found = shrunk(log_depth, uncertainty, score, rgb)
        torch.testing.assert_close(found, wanted, rtol=1e-4, atol=1e-4)


def test_an_unsure_block_sinks_into_its_ground() -> None:
    log_depth, uncertainty = block()
    found = shrunk(log_depth, uncertainty, OUT, GREY)
    assert float(found[10:14, 10:14].min()) > 0.8
    torch.testing.assert_close(found[:6], log_depth[:6], rtol=0, atol=1e-3)


def test_a_sure_block_stays() -> None:
    log_depth, uncertainty = block()
    found = shrunk(log_depth, uncertainty.clamp_max(0.01), OUT, GREY)
    assert float((found - log_depth).abs().max()) < 0.01


def test_no_ramp_goes_round_an_object_of_another_colour() -> None:
    log_depth, uncertainty = torch.ones(SIDE, SIDE), torch.full((SIDE, SIDE), 0.01)
    log_depth[:, :12], uncertainty[:, 8:16] = 0.0, 2.0
    rgb = GREY.clone()
    rgb[:, :12] = 0.9
    edge = slice(11, 13)
    ramp, step = (shrunk(log_depth, uncertainty, OUT, one)[:, edge].diff() for one in (GREY, rgb))
    assert float(ramp.max()) < 0.2 and float(step.min()) > 0.9


def test_an_image_like_those_of_training_stays_as_it_is() -> None:
    log_depth, uncertainty = block()
    assert torch.equal(shrunk(log_depth, uncertainty, IN, GREY), log_depth)


@pytest.mark.parametrize("uncertainty", [0.0, 0.0025, 7.4, 1e20])
@pytest.mark.parametrize("contrast", [0.0, 1.0, 1e6])
def test_extreme_maps_stay_finite_and_within_their_range(
    uncertainty: float, contrast: float
) -> None:
    log_depth = torch.tensor([[-60.0, 60.0], [60.0, -60.0]]).repeat(8, 8)
    rgb = contrast * torch.rand(16, 16, 3)
    found = shrunk(log_depth, torch.full_like(log_depth, uncertainty), OUT, rgb)
    assert bool(found.isfinite().all()) and float(found.abs().max()) <= 60.0001
