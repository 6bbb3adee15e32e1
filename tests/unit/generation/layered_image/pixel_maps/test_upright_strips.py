"""Towers become straight, everything else stays as it is."""

import math

import pytest
import torch
from image_layers import FAR_RANGES, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.upright_strips import (
    TIP_PX,
    straightened,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.depth import unproject

SIZE, FOCAL_PX = (64, 96), 80.0


def wavering() -> Tensor:
    """5.5 to 6.5 and back, row by row."""
    return 6.0 + 0.5 * torch.sin(torch.arange(SIZE[0]) / 6)


def with_strip(rows: slice, columns: slice, depth: Tensor | float) -> Tensor:
    maps = torch.full(SIZE, 20.0)
    maps[rows, columns] = depth
    return maps


def upright(pitch_deg: float, distance: float = 5.0) -> Tensor:
    """Of every row, depth of an upright line seen by a camera that looks up by ``pitch_deg``."""
    up = (SIZE[0] / 2 - torch.arange(SIZE[0]) - 0.5) / FOCAL_PX
    pitch = math.radians(pitch_deg)
    return distance / (math.cos(pitch) - math.sin(pitch) * up)[10:50, None]


TOWER = (slice(10, 50), slice(40, 46))
OUTLINE = (slice(10 - 1 - TIP_PX, 51), slice(39, 47))


def test_a_tower_that_wavers_becomes_a_straight_line_in_space() -> None:
    depth = with_strip(*TOWER, wavering()[10:50, None])
    found = straightened(depth, FOCAL_PX)
    points = unproject(pinhole(FOCAL_PX, SIZE), found)[10:50, 42]
    direction = points[-1] - points[0]
    off = torch.linalg.cross(points - points[0], direction.expand_as(points)).norm(dim=-1)
    assert float((off / direction.norm()).max()) < 1e-5
    assert float((found / depth).log().abs()[TOWER].max()) < math.log(6.5 / 5.5)
    outside = torch.ones(SIZE, dtype=torch.bool)
    outside[OUTLINE] = False
    assert torch.equal(found[outside], depth[outside])


@pytest.mark.parametrize("pitch_deg", [-9, 0, 9])
def test_an_upright_tower_stays_where_it_is(pitch_deg: float) -> None:
    depth = with_strip(*TOWER, upright(pitch_deg))
    torch.testing.assert_close(straightened(depth, FOCAL_PX)[TOWER], depth[TOWER])


@pytest.mark.parametrize("pitch_deg", [-30, 30])
def test_a_tower_that_leans_more_is_upright_on_its_foot(pitch_deg: float) -> None:
    depth = with_strip(*TOWER, upright(pitch_deg))
    found = straightened(depth, FOCAL_PX)[10:50, 42]
    torch.testing.assert_close(found[-1], depth[49, 42])
    slope = (1 / found[0] - 1 / found[-1]) * found[-1] / 39
    assert abs(float(slope)) == pytest.approx(math.tan(math.radians(10)) / FOCAL_PX, rel=1e-4)
    assert float(slope) * pitch_deg < 0


def test_the_blur_beside_a_tower_goes_and_its_outline_does_not() -> None:
    inverse = 1 / with_strip(*TOWER, 5.0)
    inverse[10:50, 37:40] = inverse[10:50, 46:49] = 0.05 * 1.4
    found = straightened(1 / inverse, FOCAL_PX)
    expected = with_strip(*OUTLINE, 5.0)
    torch.testing.assert_close(found, expected, rtol=1e-3, atol=0)


def test_a_few_wrong_rows_do_not_count() -> None:
    depth = with_strip(*TOWER, 6.0)
    depth[20:28, 40:46] = 3.0
    torch.testing.assert_close(
        straightened(depth, FOCAL_PX)[TOWER], torch.full((40, 6), 6.0), rtol=0.01, atol=0
    )


@pytest.mark.parametrize(
    ("rows", "columns", "nearest"),
    [
        (slice(10, 50), slice(30, 60), 6.0),  # Wide
        (slice(10, 18), slice(40, 42), 6.0),  # Low
        (slice(10, 30), slice(40, 48), 6.0),  # Hardly higher than wide
        (slice(10, 50), slice(40, 46), 18.5),  # Hardly nearer
        (slice(10, 50), slice(0, 6), 6.0),  # At the left edge: what is beside it?
        (slice(10, 50), slice(90, 96), 6.0),
    ],
)
def test_what_is_no_tower_stays(rows: slice, columns: slice, nearest: float) -> None:
    depth = with_strip(rows, columns, nearest)
    depth[rows, columns] *= 1 + 0.05 * torch.sin(torch.arange(64.0))[rows, None]
    torch.testing.assert_close(straightened(depth, FOCAL_PX), depth, rtol=1e-6, atol=0)


def test_a_faint_strip_beside_a_near_one_is_no_strip() -> None:
    depth = with_strip(*TOWER, 2.0)
    depth[10:50, 38] = 20 / 1.2
    found = straightened(depth, FOCAL_PX)
    assert torch.equal(found[10:50, 38], depth[10:50, 38])
    torch.testing.assert_close(found[TOWER], depth[TOWER])


def test_a_beam_aslant_stays() -> None:
    depth = with_strip(slice(0, 0), slice(0, 0), 6.0)
    for row in range(10, 50):
        depth[row, row : row + 3] = 6.0 + 0.02 * row
    torch.testing.assert_close(straightened(depth, FOCAL_PX), depth, rtol=1e-6, atol=0)


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (33, 20)])
def test_any_depth_stays_finite_and_above_zero(
    limits: tuple[float, float], size: tuple[int, int]
) -> None:
    found = straightened(random_depth(*size, limits), FOCAL_PX)
    assert found.shape == size and bool(found.isfinite().all()) and bool((found > 0).all())


def test_a_steep_line_does_not_reach_infinity() -> None:
    depth = with_strip(*TOWER, 6.0)
    depth[10:12, 40:46], depth[48:50, 40:46] = 17.0, 0.5
    found = straightened(depth, FOCAL_PX)
    assert bool((found > 0).all()) and float(found.max()) < 40
