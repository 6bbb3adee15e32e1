"""Behind depth edges the far side goes on, as far as a camera path looks."""

from dataclasses import replace

import pytest
import torch
from image_layers import layer
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.depth_edges import nearest_edge
from diff4splat.generation.layered_image.disoccluded.figure_ground import FigureGround
from diff4splat.generation.layered_image.disoccluded.occluded_layer import (
    EVEN_SHARE,
    REACH_SHARE,
    occluded_layers,
    occlusion_level,
)
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

SIDE = 48
NEAR, MIDDLE, FAR = 2.0, 3.2, 6.0
RED, GREEN, BLUE = (
    torch.tensor(color) for color in ((0.9, 0.1, 0.1), (0.1, 0.7, 0.2), (0.1, 0.2, 0.8))
)


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


def _cup_on_saucer() -> ImageLayer:
    """A red box before a green one before a blue wall."""
    pixels = _pixels(_box(16))
    rgb = torch.where(_box(16)[..., None], GREEN, pixels.rgb)
    rgb = torch.where(_box(5)[..., None], RED, rgb)
    depth = torch.where(_box(16), MIDDLE, pixels.depth)
    return replace(pixels, rgb=rgb, depth=torch.where(_box(5), NEAR, depth))


def test_the_wall_goes_on_behind_the_box() -> None:
    found = occluded_layers(_pixels()).ground
    assert torch.equal(found.mask, grown(_box(), 1))
    depth = found.depth[_box()] / FAR
    assert float(depth.min()) > 0.999 and float(depth.max()) < BEHIND + 1e-3
    torch.testing.assert_close(found.rgb[_box()], BLUE.expand(64, 3), atol=0.02, rtol=0)


def test_the_saucer_goes_on_behind_the_cup_and_the_wall_behind_the_saucer() -> None:
    found = occluded_layers(_cup_on_saucer())
    saucer = found.figures[0]
    assert bool(saucer.mask[_box(5)].all()) and not bool(saucer.mask[~_box(8)].any())
    torch.testing.assert_close(saucer.rgb[_box(5)], GREEN.expand(100, 3), atol=0.02, rtol=0)
    assert float(saucer.depth[_box(5)].max()) < BEHIND * MIDDLE + 1e-3
    rim = _box(16) & ~_box(14)
    assert bool(found.ground.mask[rim].all()) and not bool(found.ground.mask[_box(5)].any())
    blue = BLUE.expand(int(rim.sum()), 3)
    torch.testing.assert_close(found.ground.rgb[rim], blue, atol=0.02, rtol=0)


def test_relief_has_its_own_colours_behind_it() -> None:
    """A nose on a face on a head: nothing of the wall comes into view beside the nose."""
    pixels = _cup_on_saucer()
    nose = _box(2)
    depth = torch.where(nose, 0.8 * NEAR, torch.where(_box(10), NEAR, pixels.depth))
    rgb = torch.where(_box(10)[..., None], RED, pixels.rgb)
    found = occluded_layers(replace(pixels, depth=depth, rgb=rgb))
    own = found.figures[-1]
    assert bool(own.mask[nose].all())
    torch.testing.assert_close(own.rgb[nose], RED.expand(16, 3), atol=0.02, rtol=0)


def test_an_outline_that_is_off_by_a_cell_changes_no_level() -> None:
    """Masks come from a copy: some pixels right beside a figure count as it."""
    edge = grown(_box(8), 1) & ~_box(8)
    division = FigureGround(figure=grown(_box(8), 1), before_figure=_box(3))
    assert not bool(occlusion_level(division, nearest_edge(edge)).any())
    inner = grown(_box(3), 1) & ~_box(3)
    assert bool((occlusion_level(division, nearest_edge(inner)) == 1).all())


def test_the_network_paints_ground_and_figures_but_no_relief() -> None:
    calls = []

    def inpaint(rgb: Tensor, mask: Tensor) -> Tensor:
        calls.append(mask)
        return rgb

    pixels = _cup_on_saucer()
    nose = torch.where(_box(2), 0.8 * NEAR, torch.where(_box(10), NEAR, pixels.depth))
    rgb = torch.where(_box(10)[..., None], RED, pixels.rgb)
    assert len(occluded_layers(replace(pixels, depth=nose, rgb=rgb), inpaint).all) == 3
    assert [mask.shape for mask in calls] == [(SIDE, SIDE), (SIDE // 2, SIDE // 2)], "strips: half"


def test_no_part_of_a_figure_is_known() -> None:
    """Else what is inpainted goes on from the figure in place of the ground."""
    known = []

    def inpaint(rgb: Tensor, mask: Tensor) -> Tensor:
        known.append((rgb, mask))
        return rgb

    pixels = _pixels(_box(8))
    nose = replace(pixels, depth=torch.where(_box(2), 0.9 * NEAR, pixels.depth))
    occluded_layers(nose, inpaint)
    assert not bool(known[0][1][_box(8)].any())


def test_colours_are_even_far_from_all_cells() -> None:
    """A network would paint an object into a large hole."""
    known = []

    def inpaint(rgb: Tensor, mask: Tensor) -> Tensor:
        known.append((rgb, mask))
        return rgb

    columns = torch.arange(192)
    near = ((columns > 8) & (columns < 184)).expand(24, 192)
    rgb = torch.where(near[..., None], RED, BLUE)
    index = torch.zeros(24, 192).long()
    occluded_layers(layer(torch.where(near, NEAR, FAR), rgb=rgb, pixel_index=index), inpaint)
    rgb, mask = known[0]
    beyond = int(192 * (REACH_SHARE + EVEN_SHARE)) + 12
    inner = (slice(None), slice(beyond, 192 - beyond))
    assert bool(mask[inner].all()) and not bool(mask[:, 12:60].any())
    torch.testing.assert_close(rgb[inner], BLUE.expand_as(rgb[inner]), atol=0.02, rtol=0)


def test_it_is_static_and_not_of_the_image() -> None:
    for found in occluded_layers(_cup_on_saucer()).all:
        assert found.displacement is None and not found.in_image
        assert bool((found.pixel_index == NO_PIXEL).all())


def test_it_is_never_before_the_image() -> None:
    pixels = _cup_on_saucer()
    for found in occluded_layers(pixels).all:
        assert bool((found.depth >= BEHIND * pixels.depth)[found.mask].all())


def test_it_reaches_as_far_as_a_path_looks() -> None:
    half = SIDE // 2 - 2
    found = occluded_layers(_pixels(_box(half))).ground
    assert bool(found.mask[2, SIDE // 2]) and not bool(found.mask[SIDE // 2, SIDE // 2])
    assert int(found.mask[: SIDE // 2, SIDE // 2].sum()) <= REACH_SHARE * SIDE + 2


@pytest.mark.parametrize("near", [torch.zeros(SIDE, SIDE), torch.ones(SIDE, SIDE)])
def test_there_is_none_without_edges(near: Tensor) -> None:
    found = occluded_layers(_pixels(near.bool()))
    assert found.ground is None and found.all == []


def test_colours_beside_an_edge_are_not_those_of_the_far_side() -> None:
    columns = torch.arange(192)
    near = ((columns > 80) & (columns < 110)).expand(16, 192)
    mixed = ((columns > 77) & (columns < 113)).expand(16, 192)
    rgb = torch.where(mixed[..., None], RED, BLUE)
    pixels = layer(torch.where(near, NEAR, FAR), rgb=rgb, pixel_index=torch.zeros(16, 192).long())
    found = occluded_layers(pixels).ground
    inside = found.rgb[near & found.mask]
    torch.testing.assert_close(inside, BLUE.expand_as(inside), atol=0.02, rtol=0)


def test_what_moves_has_a_layer_of_its_own() -> None:
    displacement = torch.zeros(2, SIDE, SIDE, 3)
    displacement[1, _box()] = 0.5
    assert occluded_layers(_pixels(displacement=displacement)).all == []


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_any_unit_will_do(scale: float) -> None:
    pixels = _pixels()
    found = occluded_layers(replace(pixels, depth=scale * pixels.depth)).ground
    want = occluded_layers(pixels).ground
    assert torch.equal(found.mask, want.mask)
    torch.testing.assert_close(found.depth / scale, want.depth)
    assert bool(found.rgb.isfinite().all())
