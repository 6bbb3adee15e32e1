"""Round bodies from outlines, and the side that the image hides."""

import pytest
import torch
from image_layers import layer
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.motion.local_motion.body import rounded
from diff4splat.generation.motion.local_motion.hidden_side import (
    RIM_PX,
    hidden_side,
    interior_colors,
)
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.scene.harmonics import dc_from_color

SIDE, FOCAL_PX, DEPTH = 48, 48.0, 6.0


def box(first: int, last: int) -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[first:last, first:last] = True
    return mask


def disc(radius_px: float) -> Tensor:
    at = torch.arange(SIDE) + 0.5 - SIDE / 2
    return at.square()[:, None] + at.square() < radius_px**2


def test_a_disc_becomes_the_front_of_a_ball() -> None:
    inside, depth = disc(16.0), torch.full((SIDE, SIDE), DEPTH)
    body, middle = rounded(depth, inside, FOCAL_PX, RIM_PX)
    assert torch.equal(body[~inside], depth[~inside])
    radius = middle * 16 / FOCAL_PX
    assert float(middle - body[SIDE // 2, SIDE // 2]) == pytest.approx(radius, rel=0.05)
    at = (torch.arange(SIDE) + 0.5 - SIDE / 2)[disc(13.0)[SIDE // 2]]
    want = middle * (1 - (16**2 - at.square()).sqrt() / FOCAL_PX)
    found = body[SIDE // 2][disc(13.0)[SIDE // 2]]
    torch.testing.assert_close(found, want, atol=0.05 * radius, rtol=0)
    assert float(body[inside].median()) == pytest.approx(DEPTH)


@pytest.mark.parametrize("first", [0, 23])
def test_bodies_of_a_whole_image_or_of_a_pixel_are_before_the_camera(first: int) -> None:
    inside = box(first, SIDE if first == 0 else first + 1)
    body, middle = rounded(torch.full((SIDE, SIDE), DEPTH), inside, 10.0, RIM_PX)
    assert bool((body > 0).all()) and bool(body.isfinite().all()) and middle > 0


def cone() -> Tensor:
    """16 px high, as wide as high."""
    row, column = torch.meshgrid(*[torch.arange(SIDE) + 0.5] * 2, indexing="ij")
    return (row > 16) & (row < 32) & ((column - SIDE / 2).abs() < (row - 16) / 2)


def test_rows_of_a_cone_are_as_deep_as_wide_up_to_the_largest_circle() -> None:
    body, middle = rounded(torch.full((SIDE, SIDE), DEPTH), cone(), FOCAL_PX, 0)
    before_px = (middle - body) / middle * FOCAL_PX
    deepest = torch.where(cone(), before_px, 0).amax(1)[16:32]
    half_width = cone().sum(1)[16:32] / 2
    torch.testing.assert_close(deepest[2:8], half_width[2:8], atol=0.15, rtol=0)
    assert float(deepest.max()) < 5.5 < float(half_width.max())


def test_a_block_is_as_deep_at_its_top_as_in_its_middle() -> None:
    body, _ = rounded(torch.full((SIDE, SIDE), DEPTH), box(16, 32), FOCAL_PX, RIM_PX)
    assert torch.equal(body[16], body[24])


def test_the_back_mirrors_the_front_and_the_front_hides_it() -> None:
    """Each of its points has the height and width of one of the front."""
    inside = disc(16.0)
    body, middle = rounded(torch.full((SIDE, SIDE), DEPTH), inside, FOCAL_PX, RIM_PX)
    pixels = layer(body)
    back = hidden_side(pixels, inside, middle, pixels.rgb)
    at, z = project(pixels.camera, back.means)
    column, row = at.floor().long().unbind(-1)
    assert bool(inside[row, column].all())
    # Nothing lies before the front, and the farthest cell is as far behind the middle.
    assert bool((z >= body[row, column] - 0.05).all())
    farthest = 2 * middle - float(body[inside].min())
    assert float(z.max()) == pytest.approx(farthest, rel=1e-4)
    front = unproject(pixels.camera, body)[~grown(~inside, RIM_PX)]
    mirrored = back.means[: len(front)]
    torch.testing.assert_close(mirrored[:, 2], 2 * middle - front[:, 2])
    torch.testing.assert_close(mirrored[:, :2], front[:, :2], atol=1e-4, rtol=0)


def test_off_the_axis_too_the_back_stays_within_the_outline() -> None:
    inside = box(2, 20)
    body, middle = rounded(torch.full((SIDE, SIDE), DEPTH), inside, FOCAL_PX, RIM_PX)
    pixels = layer(body)
    at, _ = project(pixels.camera, hidden_side(pixels, inside, middle, pixels.rgb).means)
    column, row = at.floor().long().unbind(-1)
    assert bool(inside[row, column].all())


def test_the_surface_is_closed() -> None:
    """From the side no gap between cells is wider than two of them."""
    inside = disc(16.0)
    body, middle = rounded(torch.full((SIDE, SIDE), DEPTH), inside, FOCAL_PX, RIM_PX)
    pixels, row = layer(body), SIDE // 2
    back = hidden_side(pixels, inside, middle, pixels.rgb)
    at, z = project(pixels.camera, back.means)
    front = body[row][disc(16.0 - RIM_PX)[row]]
    along = torch.cat([z[(at[:, 1] - 0.5).round().long() == row], front]).sort().values
    spacing = float(middle / pixels.camera.focal_px[0])
    assert float(along.diff().max()) < 2 * spacing


def test_an_object_of_nothing_but_rim_has_no_back() -> None:
    pixels = layer(torch.full((SIDE, SIDE), DEPTH))
    assert len(hidden_side(pixels, box(20, 23), DEPTH, pixels.rgb)) == 0


def test_colours_of_the_interior_go_on_to_the_outline() -> None:
    inside, rgb = disc(16.0), torch.zeros(SIDE, SIDE, 3)
    rgb[disc(12.0)] = 1.0
    pixels = layer(torch.full((SIDE, SIDE), DEPTH), rgb=rgb)
    pure, mixed = (interior_colors(pixels, inside, margin) for margin in (6, RIM_PX))
    assert float(pure[inside].min()) == 1.0 > float(mixed[inside].min())
    # Nothing is as far from the outline: the colours as they are.
    assert torch.equal(interior_colors(pixels, inside, SIDE), rgb)
    back = hidden_side(pixels, inside, DEPTH, pure)
    torch.testing.assert_close(back.sh, dc_from_color(torch.ones(len(back), 3))[:, None])


def test_the_rim_is_as_far_as_the_pixels_next_to_it() -> None:
    inside = box(8, 40)
    body, _ = rounded(torch.full((SIDE, SIDE), DEPTH), inside, FOCAL_PX, RIM_PX)
    row = body[SIDE // 2, 8:14]
    assert bool((row[: RIM_PX + 1] == row[RIM_PX]).all()) and float(row[RIM_PX + 1]) < float(row[0])
