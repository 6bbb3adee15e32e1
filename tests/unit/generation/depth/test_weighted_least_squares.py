"""Weighted least squares on a grid: the formula, its limits, extreme weights."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.generation.depth.weighted_least_squares import (
    Grid,
    between_colors,
    least_squares,
)


def uniform(weight: torch.Tensor, bond: float) -> Grid:
    return Grid(
        weight=weight,
        across=torch.full_like(weight[:, 1:], bond),
        down=torch.full_like(weight[1:], bond),
    )


@given(seed=st.integers(0, 10_000), height=st.integers(1, 9), width=st.integers(1, 9))
def test_the_solution_holds_the_normal_equations(seed: int, height: int, width: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    values, weight, across, down = (
        torch.rand(shape, generator=generator, dtype=torch.float64)
        for shape in ((height, width), (height, width), (height, width - 1), (height - 1, width))
    )
    grid = Grid(weight=weight + 0.01, across=10 * across, down=10 * down)
    found = least_squares(values, grid)
    torch.testing.assert_close(grid.product(found), grid.weight * values, rtol=0, atol=1e-4)
    assert bool((found >= values.min()).all()) and bool((found <= values.max()).all())


def test_the_product_is_that_of_the_energy() -> None:
    torch.manual_seed(0)
    values = torch.rand(5, 7, dtype=torch.float64, requires_grad=True)
    weight = torch.rand(5, 7, dtype=torch.float64)
    grid = Grid(weight=weight, across=torch.rand(5, 6).double(), down=torch.rand(4, 7).double())
    energy = (weight * values.square()).sum()
    energy = energy + (grid.across * values.diff(dim=1).square()).sum()
    energy = energy + (grid.down * values.diff(dim=0).square()).sum()
    (gradient,) = torch.autograd.grad(energy / 2, values)
    torch.testing.assert_close(grid.product(values.detach()), gradient)
    columns = torch.eye(35, dtype=torch.float64).unflatten(1, (5, 7))
    diagonal = torch.stack([(one * grid.product(one)).sum() for one in columns])
    torch.testing.assert_close(grid.diagonal().flatten(), diagonal)


def test_without_bonds_nothing_changes_and_strong_ones_give_the_weighted_mean() -> None:
    torch.manual_seed(0)
    values, weight = torch.rand(6, 8), torch.rand(6, 8, dtype=torch.float64) + 0.1
    torch.testing.assert_close(least_squares(values, uniform(weight, 0.0)), values)
    mean = (weight * values).sum() / weight.sum()
    found = least_squares(values, uniform(weight, 1e4))
    torch.testing.assert_close(found, mean.float().expand_as(values), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("weight", [1e-30, 1.0, 1e30])
@pytest.mark.parametrize("bond", [0.0, 1e-30, 1e30])
@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_extreme_systems_stay_finite_and_in_range(weight: float, bond: float, size: float) -> None:
    values = size * torch.linspace(-1, 1, 24).view(4, 6)
    grid = uniform(torch.full((4, 6), weight, dtype=torch.float64), bond)
    found = least_squares(values, grid)
    assert bool(found.isfinite().all()) and bool((found.abs() <= values.abs().max()).all())


def test_bonds_fall_with_the_difference_of_colours() -> None:
    rgb = torch.tensor([[[0.0, 0, 0], [0, 0, 0], [0.5, 0, 0], [0.5, 0, 0.1]]])
    across, down = between_colors(rgb, 0.1, 1e-3)
    wanted = torch.tensor([[0.0, -5.0, -1.0]]).double().exp() + 1e-3
    torch.testing.assert_close(across, wanted, rtol=1e-6, atol=0)
    assert down.shape == (0, 4)
