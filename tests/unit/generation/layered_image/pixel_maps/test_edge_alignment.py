"""Depth edges move onto the edges of colour beside them, where there are any."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from image_layers import FAR_RANGES, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.edge_alignment import (
    align_edges,
    align_static_edges,
    beside_edges,
)
from diff4splat.generation.layered_image.types import DEPTH_STEP

SIZE_PX, EDGE, CELL_PX = (24, 32), 16, 2
NEAR, FAR = 2.0, 3.0
RED, BLUE = torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.2, 0.8])


def colors(edge: int = EDGE) -> Tensor:
    """Red to the left of a column, blue to its right."""
    is_left = torch.arange(SIZE_PX[1]) < edge
    return torch.where(is_left[:, None], RED, BLUE).expand(*SIZE_PX, 3)


def step(edge: int, near: float = NEAR, far: float = FAR) -> Tensor:
    return torch.where(torch.arange(SIZE_PX[1]) < edge, near, far).expand(SIZE_PX)


@pytest.mark.parametrize("beside", [-2, -1, 0, 1, 2])
def test_an_edge_beside_that_of_colour_moves_there(beside: int) -> None:
    aligned = align_edges(step(EDGE + beside), colors(), CELL_PX)
    torch.testing.assert_close(aligned, step(EDGE))


def test_a_blurred_edge_becomes_sharp() -> None:
    depth = step(EDGE).clone()
    depth[:, EDGE - 1], depth[:, EDGE] = 2.3, 2.7
    aligned = align_edges(depth, colors(), CELL_PX)
    torch.testing.assert_close(aligned, step(EDGE))


def test_pixels_of_mixed_colour_belong_to_the_foreground() -> None:
    rgb = colors().clone()
    rgb[:, EDGE] = 0.4 * RED + 0.6 * BLUE
    torch.testing.assert_close(align_edges(step(EDGE), rgb, CELL_PX), step(EDGE + 1))


def test_where_colours_do_not_tell_depth_stays() -> None:
    depth = step(EDGE + 2)
    assert torch.equal(align_edges(depth, torch.full((*SIZE_PX, 3), 0.5), CELL_PX), depth)
    generator = torch.Generator().manual_seed(0)
    noise = torch.rand(*SIZE_PX, 3, generator=generator)
    changed = (align_edges(depth, noise, CELL_PX) / depth - 1).abs() > 1e-3
    assert float(changed.float().mean()) < 0.02


def test_far_from_edges_depth_stays() -> None:
    depth = step(EDGE + 1)
    changed = (align_edges(depth, colors(EDGE), CELL_PX) / depth - 1).abs() > 1e-3
    assert changed.any(0).nonzero()[:, 0].tolist() == [EDGE]


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_steps_below_the_threshold_are_no_edges(share: float) -> None:
    far = NEAR * float(torch.tensor(share * DEPTH_STEP).exp())
    assert not bool(beside_edges(step(EDGE, far=far).log(), CELL_PX).any())


@pytest.mark.parametrize("slope", [0.01, 0.1, 0.5])
def test_slopes_are_no_edges(slope: float) -> None:
    log_depth = (slope * torch.arange(float(SIZE_PX[1]))).expand(SIZE_PX)
    assert not bool(beside_edges(log_depth, CELL_PX)[:, 4:-4].any())


def test_what_moves_keeps_its_own_edges() -> None:
    displacement = torch.zeros(2, *SIZE_PX, 3)
    displacement[1, :, : EDGE + 1] = 0.5
    depth = step(EDGE + 1)
    assert torch.equal(align_static_edges(depth, displacement, colors(), CELL_PX), depth)
    assert not torch.equal(align_static_edges(depth, None, colors(), CELL_PX), depth)


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("cell_px", [1, 2, 5])
@pytest.mark.parametrize("size", [(1, 1), (1, 7), (9, 2), (16, 16)])
def test_any_depth_and_size_stays_in_range(
    limits: tuple[float, float], cell_px: int, size: tuple[int, int]
) -> None:
    depth = random_depth(*size, limits)
    aligned = align_edges(depth, torch.rand(*size, 3), cell_px)
    assert bool(aligned.isfinite().all())
    assert float(aligned.min()) >= 0.999 * float(depth.min())
    assert float(aligned.max()) <= 1.001 * float(depth.max())


@given(seed=st.integers(0, 10**6), unit=st.sampled_from([2.0**-40, 2.0**40]))
def test_any_unit_will_do(seed: int, unit: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    depth = torch.exp(torch.randn(10, 11, generator=generator, dtype=torch.float64))
    rgb = torch.rand(10, 11, 3, generator=generator, dtype=torch.float64)
    aligned = align_edges(unit * depth, rgb, CELL_PX)
    torch.testing.assert_close(aligned / unit, align_edges(depth, rgb, CELL_PX))
