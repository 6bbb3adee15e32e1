"""The square on the disc: everywhere inside, areas kept, no hole in the middle."""

import math

import pytest
import torch

from diff4splat.render.physical.concentric_disc import disc_points


def grid(edge: int) -> torch.Tensor:
    """Middles of the cells of the square."""
    middles = (torch.arange(edge, dtype=torch.float64) + 0.5) / edge
    return torch.stack(torch.meshgrid(middles, middles, indexing="ij"), -1)


@pytest.mark.parametrize(
    ("square", "disc"),
    [
        ((0.5, 0.5), (0.0, 0.0)),
        ((1.0, 0.5), (1.0, 0.0)),
        ((0.0, 0.5), (-1.0, 0.0)),
        ((0.5, 1.0), (0.0, 1.0)),
        ((0.5, 0.0), (0.0, -1.0)),
        ((1.0, 1.0), (math.sqrt(0.5), math.sqrt(0.5))),
        ((0.0, 1.0), (-math.sqrt(0.5), math.sqrt(0.5))),
        ((0.75, 0.5), (0.5, 0.0)),
        ((0.75, 0.625), (0.5 * math.cos(math.pi / 8), 0.5 * math.sin(math.pi / 8))),
    ],
)
def test_known_points(square: tuple[float, float], disc: tuple[float, float]) -> None:
    got = disc_points(torch.tensor(square, dtype=torch.float64))
    torch.testing.assert_close(got, torch.tensor(disc, dtype=torch.float64))


def test_points_stay_inside_and_have_the_mean_and_variance_of_a_disc() -> None:
    points = disc_points(grid(500)).flatten(0, 1)
    assert float(points.norm(dim=1).max()) <= 1
    assert float(points.mean(0).abs().max()) < 1e-12
    torch.testing.assert_close(points.T.cov(), torch.eye(2).double() / 4, rtol=0, atol=1e-5)


def test_areas_are_kept() -> None:
    points = grid(40).flatten(0, 1)
    # A finite difference across a diagonal would mix two pieces of the map.
    sure = ((points - 0.5).abs().diff(dim=1).abs() > 1e-3).squeeze(1)
    step, columns = 1e-6, []
    for axis in torch.eye(2, dtype=torch.float64):
        ahead, behind = disc_points(points + step * axis), disc_points(points - step * axis)
        columns.append((ahead - behind) / (2 * step))
    area = torch.linalg.det(torch.stack(columns, -1))
    torch.testing.assert_close(area[sure], torch.full_like(area[sure], math.pi), rtol=1e-6, atol=0)
    assert float(sure.double().mean()) > 0.9


def test_squares_become_circles() -> None:
    square = grid(30)
    radius = (2 * square - 1).abs().amax(-1)
    torch.testing.assert_close(disc_points(square).norm(dim=-1), radius)


def test_neighbours_stay_neighbours() -> None:
    points = disc_points(grid(200))
    # The map's steepest derivative is (2, π/2), on the diagonals.
    for axis in (0, 1):
        assert float(points.diff(dim=axis).norm(dim=-1).max()) < 2.55 / 200


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_dtype_and_shape_are_kept(dtype: torch.dtype) -> None:
    assert disc_points(torch.full((2, 3, 2), 0.5, dtype=dtype)).dtype == dtype
    assert disc_points(torch.zeros(0, 2, dtype=dtype)).shape == (0, 2)


def test_the_gradient_is_finite_even_in_the_middle() -> None:
    square = torch.tensor([[0.5, 0.5], [0.2, 0.8], [0.9, 0.4]], dtype=torch.float64)
    square.requires_grad_()
    disc_points(square).sum().backward()
    assert bool(torch.isfinite(square.grad).all())
