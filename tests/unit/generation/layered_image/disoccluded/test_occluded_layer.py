"""Behind depth edges the far side goes on, as far as a camera path looks."""

from dataclasses import replace

import pytest
import torch
from image_layers import layer
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.occluded_layer import (
    DEPTH_STEP,
    REACH_SHARE,
    far_side_of_edges,
    nearest_edge,
    occluded_layer,
)
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

SIDE = 48
NEAR, FAR = 2.0, 6.0
RED, BLUE = torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.2, 0.8])


def _box(half: int = 4) -> Tensor:
    box = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    box[SIDE // 2 - half : SIDE // 2 + half, SIDE // 2 - half : SIDE // 2 + half] = True
    return box


def _pixels(near: Tensor | None = None, displacement: Tensor | None = None) -> ImageLayer:
    """A red box before a blue wall."""
    near = _box() if near is None else near
    rgb = torch.where(near[..., None], RED, BLUE)
    index = torch.arange(SIDE * SIDE).view(SIDE, SIDE)
    depth = torch.where(near, NEAR, FAR)
    return layer(depth, rgb=rgb, displacement=displacement, pixel_index=index)


def test_the_wall_goes_on_behind_the_box() -> None:
    found = occluded_layer(_pixels())
    assert torch.equal(found.mask, grown(_box(), 1))
    depth = found.depth[_box()] / FAR
    assert float(depth.min()) > 0.999 and float(depth.max()) < BEHIND + 1e-3
    torch.testing.assert_close(found.rgb[_box()], BLUE.expand(64, 3), atol=0.02, rtol=0)


def test_it_is_static_and_not_of_the_image() -> None:
    found = occluded_layer(_pixels())
    assert found.displacement is None and not found.in_image
    assert bool((found.pixel_index == NO_PIXEL).all())


def test_it_is_never_before_the_image() -> None:
    pixels = _pixels()
    found = occluded_layer(pixels)
    assert bool((found.depth >= BEHIND * pixels.depth)[found.mask].all())


def test_it_reaches_as_far_as_a_path_looks() -> None:
    half = SIDE // 2 - 2
    found = occluded_layer(_pixels(_box(half)))
    assert bool(found.mask[2, SIDE // 2]) and not bool(found.mask[SIDE // 2, SIDE // 2])
    assert int(found.mask[: SIDE // 2, SIDE // 2].sum()) <= REACH_SHARE * SIDE + 2


@pytest.mark.parametrize("near", [torch.zeros(SIDE, SIDE), torch.ones(SIDE, SIDE)])
def test_there_is_none_without_edges(near: Tensor) -> None:
    assert occluded_layer(_pixels(near.bool())) is None


def test_a_slanted_floor_has_no_edges() -> None:
    depth = torch.exp(torch.linspace(2, 0, SIDE))[:, None].expand(SIDE, SIDE)
    assert not bool(far_side_of_edges(depth).any())


def test_steps_below_the_threshold_are_no_edges() -> None:
    for share, any_edge in ((0.9, False), (1.1, True)):
        far = NEAR * torch.tensor(share * DEPTH_STEP).exp()
        depth = torch.where(_box(), torch.tensor(NEAR), far)
        assert bool(far_side_of_edges(depth).any()) is any_edge


def test_the_middle_of_a_smoothed_edge_is_not_its_far_side() -> None:
    profile = torch.tensor([NEAR] * 8 + [3.0, 4.0, 5.0] + [FAR] * 9)
    edge = far_side_of_edges(profile.expand(6, 20))
    assert torch.equal(edge.any(0).nonzero()[:, 0], torch.tensor([11, 12]))


def test_a_far_side_may_slope() -> None:
    profile = torch.cat([torch.full((8,), NEAR), FAR * torch.exp(0.07 * torch.arange(12.0))])
    edge = far_side_of_edges(profile.expand(9, 20))
    assert edge[4].nonzero()[:, 0].tolist() == [8, 9]


def test_colours_beside_an_edge_are_not_those_of_the_far_side() -> None:
    columns = torch.arange(192)
    near = ((columns > 80) & (columns < 110)).expand(16, 192)
    mixed = ((columns > 77) & (columns < 113)).expand(16, 192)
    rgb = torch.where(mixed[..., None], RED, BLUE)
    pixels = layer(torch.where(near, NEAR, FAR), rgb=rgb, pixel_index=torch.zeros(16, 192).long())
    found = occluded_layer(pixels)
    inside = found.rgb[near & found.mask]
    torch.testing.assert_close(inside, BLUE.expand_as(inside), atol=0.02, rtol=0)


def test_what_moves_has_a_layer_of_its_own() -> None:
    displacement = torch.zeros(2, SIDE, SIDE, 3)
    displacement[1, _box()] = 0.5
    assert occluded_layer(_pixels(displacement=displacement)) is None


def test_the_nearest_edge_of_a_pixel() -> None:
    edge = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    edge[0, 0] = edge[SIDE - 1, SIDE - 1] = True
    depth = torch.full((SIDE, SIDE), NEAR)
    depth[0, 0] = FAR
    found = nearest_edge(depth, edge)
    assert float(found.log_depth[3, 4].exp()) == pytest.approx(FAR)
    assert float(found.log_depth[-3, -4].exp()) == pytest.approx(NEAR)
    assert float(found.distance_px[3, 4]) == pytest.approx(5, rel=0.05)


@pytest.mark.parametrize("size", [(1, 1), (3, 3), (4, 9)])
def test_small_images_have_edges_too(size: tuple[int, int]) -> None:
    depth = torch.full(size, FAR)
    depth[:, 0] = NEAR
    edge = far_side_of_edges(depth)
    assert edge.shape == size
    assert bool(edge[:, 1:3].all()) and not bool(edge[:, :1].any())


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_any_unit_will_do(scale: float) -> None:
    pixels = _pixels()
    found = occluded_layer(replace(pixels, depth=scale * pixels.depth))
    want = occluded_layer(pixels)
    assert torch.equal(found.mask, want.mask)
    torch.testing.assert_close(found.depth / scale, want.depth)
    assert bool(found.rgb.isfinite().all())
