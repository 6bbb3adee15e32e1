"""Towers become straight, everything else stays as it is."""

import math

import pytest
import torch
from image_layers import FAR_RANGES, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.upright_strips import straightened
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.depth import unproject

SIZE = (64, 96)


def wavering() -> Tensor:
    """5.5 to 6.5 and back, row by row."""
    return 6.0 + 0.5 * torch.sin(torch.arange(SIZE[0]) / 6)


def with_strip(rows: slice, columns: slice, depth: Tensor | float) -> Tensor:
    maps = torch.full(SIZE, 20.0)
    maps[rows, columns] = depth
    return maps


TOWER = (slice(10, 50), slice(40, 46))


def test_a_tower_that_wavers_becomes_a_straight_line_in_space() -> None:
    depth = with_strip(*TOWER, wavering()[10:50, None])
    found = straightened(depth)
    points = unproject(pinhole(80.0, SIZE), found)[10:50, 42]
    direction = points[-1] - points[0]
    off = torch.linalg.cross(points - points[0], direction.expand_as(points)).norm(dim=-1)
    assert float((off / direction.norm()).max()) < 1e-5
    assert float((found / depth).log().abs()[TOWER].max()) < math.log(6.5 / 5.5)
    outside = torch.ones(SIZE, dtype=torch.bool)
    outside[TOWER] = False
    assert torch.equal(found[outside], depth[outside])


def test_a_straight_tower_stays_where_it_is() -> None:
    inverse = torch.linspace(0.12, 0.2, 40)
    depth = with_strip(*TOWER, (1 / inverse)[:, None])
    torch.testing.assert_close(straightened(depth), depth)


def test_a_few_wrong_rows_do_not_count() -> None:
    depth = with_strip(*TOWER, 6.0)
    depth[20:28, 40:46] = 3.0
    torch.testing.assert_close(
        straightened(depth)[TOWER], torch.full((40, 6), 6.0), rtol=0.01, atol=0
    )


@pytest.mark.parametrize(
    ("rows", "columns", "nearest"),
    [
        (slice(10, 50), slice(30, 60), 6.0),  # Wide
        (slice(10, 18), slice(40, 42), 6.0),  # Low
        (slice(10, 30), slice(40, 48), 6.0),  # Hardly higher than wide
        (slice(10, 50), slice(40, 46), 18.5),  # Hardly nearer
    ],
)
def test_what_is_no_tower_stays(rows: slice, columns: slice, nearest: float) -> None:
    depth = with_strip(rows, columns, nearest)
    depth[rows, columns] *= 1 + 0.05 * torch.sin(torch.arange(64.0))[rows, None]
    torch.testing.assert_close(straightened(depth), depth, rtol=1e-6, atol=0)


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (33, 20)])
def test_any_depth_stays_finite_and_above_zero(
    limits: tuple[float, float], size: tuple[int, int]
) -> None:
    found = straightened(random_depth(*size, limits))
    assert found.shape == size and bool(found.isfinite().all()) and bool((found > 0).all())


def test_a_steep_line_does_not_reach_infinity() -> None:
    depth = with_strip(*TOWER, 6.0)
    depth[10:12, 40:46], depth[48:50, 40:46] = 17.0, 0.5
    found = straightened(depth)
    assert bool((found > 0).all()) and float(found.max()) < 40
