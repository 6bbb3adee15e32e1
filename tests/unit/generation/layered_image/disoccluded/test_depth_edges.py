"""Depth edges, their far side, and the one nearest to each pixel."""

import pytest
import torch

from diff4splat.generation.layered_image.disoccluded.depth_edges import (
    DEPTH_STEP,
    far_side_of_edges,
    nearest_edge,
    step_of_edges,
    within,
)

SIDE = 48
NEAR, FAR = 2.0, 6.0


def test_a_slanted_floor_has_no_edges() -> None:
    depth = torch.exp(torch.linspace(2, 0, SIDE))[:, None].expand(SIDE, SIDE)
    assert not bool(far_side_of_edges(depth).any())


@pytest.mark.parametrize(("share", "is_edge"), [(0.9, False), (1.1, True)])
def test_steps_below_the_threshold_are_no_edges(share: float, is_edge: bool) -> None:
    depth = torch.full((SIDE, SIDE), NEAR)
    depth[:, SIDE // 2 :] *= torch.tensor(share * DEPTH_STEP).exp()
    assert bool(far_side_of_edges(depth).any()) is is_edge


def test_the_middle_of_a_smoothed_edge_is_not_its_far_side() -> None:
    profile = torch.tensor([NEAR] * 8 + [3.0, 4.0, 5.0] + [FAR] * 9)
    edge = far_side_of_edges(profile.expand(6, 20))
    assert torch.equal(edge.any(0).nonzero()[:, 0], torch.tensor([11, 12]))


def test_the_near_side_is_the_far_side_of_inverse_depth() -> None:
    profile = torch.tensor([NEAR] * 8 + [FAR] * 12).expand(9, 20)
    assert far_side_of_edges(profile)[4].nonzero()[:, 0].tolist() == [8, 9]
    assert far_side_of_edges(1 / profile)[4].nonzero()[:, 0].tolist() == [6, 7]


def test_a_far_side_may_slope() -> None:
    profile = torch.cat([torch.full((8,), NEAR), FAR * torch.exp(0.07 * torch.arange(12.0))])
    edge = far_side_of_edges(profile.expand(9, 20))
    assert edge[4].nonzero()[:, 0].tolist() == [8, 9]


def test_a_step_is_the_ratio_to_the_nearest_around() -> None:
    depth = torch.full((9, 9), FAR)
    depth[4, 4] = NEAR
    step = step_of_edges(depth)
    assert float(step[4, 6].exp()) == pytest.approx(FAR / NEAR)
    assert float(step[4, 7]) == 0 and float(step[4, 4]) == 0


def test_the_nearest_edge_of_a_pixel() -> None:
    edge = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    edge[0, 0] = edge[SIDE - 1, SIDE - 1] = True
    depth = torch.full((SIDE, SIDE), NEAR)
    depth[0, 0] = FAR
    found = nearest_edge(edge)
    assert int(found.pixel[3, 4]) == 0 and int(found.pixel[-3, -4]) == SIDE * SIDE - 1
    assert float(found.of(depth)[3, 4]) == FAR and float(found.of(depth)[-3, -4]) == NEAR
    assert float(found.distance_px[3, 4]) == pytest.approx(5, rel=0.05)


def test_pixels_within_a_distance() -> None:
    mask = torch.zeros(9, 9, dtype=torch.bool)
    mask[4, 4] = True
    assert int(within(mask, 0.5).sum()) == 1 and int(within(mask, 1.0).sum()) == 5


@pytest.mark.parametrize("size", [(1, 1), (3, 3), (4, 9)])
def test_small_images_have_edges_too(size: tuple[int, int]) -> None:
    depth = torch.full(size, FAR)
    depth[:, 0] = NEAR
    edge = far_side_of_edges(depth)
    assert edge.shape == size
    assert bool(edge[:, 1:3].all()) and not bool(edge[:, :1].any())
