"""Objects are figures as a whole; floors, however near, are ground."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.figure_ground import (
    AROUND_SHARE,
    FIGURE_SHARE,
    LARGEST_STEP,
    MOST_SIDE_PX,
    copies,
    figure_ground,
    figure_threshold,
    seeds,
)
from diff4splat.generation.layered_image.disocclusion import grown

SIDE = 64
WALL, FLOOR, OBJECT, PART = (
    torch.tensor(color)
    for color in ((0.2, 0.3, 0.8), (0.4, 0.6, 0.3), (0.8, 0.2, 0.2), (0.9, 0.8, 0.2))
)


def _box(top: int, left: int, height: int, width: int) -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[top : top + height, left : left + width] = True
    return mask


def _wall() -> tuple[Tensor, Tensor]:
    return WALL.expand(SIDE, SIDE, 3).clone(), torch.full((SIDE, SIDE), 8.0)


def _with(
    image: tuple[Tensor, Tensor], mask: Tensor, color: Tensor, depth: float
) -> tuple[Tensor, Tensor]:
    return torch.where(mask[..., None], color, image[0]), torch.where(mask, depth, image[1])


def _room() -> tuple[Tensor, Tensor]:
    """A floor that comes nearer than a box which stands on it, before a wall."""
    rgb, depth = _wall()
    rows = slice(SIDE // 2, SIDE)
    depth[rows] = (1 / torch.linspace(1 / 8, 1 / 2, SIDE // 2))[:, None]
    rgb[rows] = FLOOR
    return _with((rgb, depth), _box(20, 24, 24, 16), OBJECT, 4.0)


def test_a_box_before_a_wall_is_figure() -> None:
    box = _box(20, 24, 20, 16)
    found = figure_ground(*_with(_wall(), box, OBJECT, 4.0))
    assert torch.equal(found.figure, box)


def test_a_floor_nearer_than_the_box_is_ground() -> None:
    found = figure_ground(*_room())
    assert bool(found.figure[22:40, 26:38].all())
    assert not bool(found.figure[SIDE - 12 :].any()) and not bool(found.figure[:18].any())


def test_a_box_of_the_colour_of_the_wall_is_figure() -> None:
    box = _box(20, 24, 20, 16)
    found = figure_ground(*_with(_wall(), box, WALL, 4.0))
    assert torch.equal(found.figure, box)


def test_what_is_far_from_every_edge_belongs_to_its_object() -> None:
    box = _box(4, 4, 56, 56)
    found = figure_ground(*_with(_wall(), box, OBJECT, 4.0))
    assert torch.equal(found.figure, box)


def test_relief_of_an_object_makes_no_part_of_it_ground() -> None:
    """The far side of a nose is a face, and not what lies behind the head."""
    head, nose = _box(10, 10, 44, 44), _box(28, 28, 8, 8)
    image = _with(_with(_wall(), head, OBJECT, 4.0), nose, OBJECT, 3.6)
    assert bool(figure_ground(*image).figure[head].all())


def test_a_cup_is_before_its_saucer() -> None:
    saucer, cup = _box(10, 10, 44, 44), _box(24, 24, 16, 16)
    image = _with(_with(_wall(), saucer, OBJECT, 4.0), cup, PART, 2.8)
    found = figure_ground(*image)
    assert torch.equal(found.figure, saucer)
    assert torch.equal(found.before_figure, cup)


def test_without_edges_all_is_ground() -> None:
    found = figure_ground(*_wall())
    assert not bool(found.figure.any()) and not bool(found.before_figure.any())


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_any_unit_will_do(scale: float) -> None:
    rgb, depth = _room()
    assert torch.equal(figure_ground(rgb, scale * depth).figure, figure_ground(rgb, depth).figure)


def test_a_large_image_is_divided_by_a_copy() -> None:
    rgb, depth = (map_.repeat_interleave(4, 0).repeat_interleave(4, 1) for map_ in _room())
    found = figure_ground(rgb, depth).figure
    small = figure_ground(*_room()).figure.repeat_interleave(4, 0).repeat_interleave(4, 1)
    assert found.shape == depth.shape
    assert float((found ^ small).float().mean()) < 0.03


def test_no_depth_of_the_copy_lies_between_two_surfaces() -> None:
    depth = torch.full((300, 300), 8.0)
    depth[:, 151:] = 4.0
    _, small = copies(torch.rand(300, 300, 3), depth)
    assert small.shape == (MOST_SIDE_PX, MOST_SIDE_PX)
    assert set(small.unique().tolist()) == {4.0, 8.0}


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (5, 3)])
def test_small_images_have_figures_too(size: tuple[int, int]) -> None:
    depth = torch.full(size, 8.0)
    depth[:, 0] = 2.0
    found = figure_ground(torch.rand(*size, 3), depth)
    assert found.figure.shape == found.before_figure.shape == size


def test_edges_are_compared_within_a_window() -> None:
    """The threshold, by its formula."""
    generator = torch.Generator().manual_seed(0)
    label, near, far = torch.rand(3, 7, 9, generator=generator, dtype=torch.float64)
    found, deviation = figure_threshold(label, near, far), AROUND_SHARE * 9
    rows, columns = torch.meshgrid(torch.arange(7), torch.arange(9), indexing="ij")
    for row, column in ((0, 0), (3, 8)):
        distance = ((rows - row).square() + (columns - column).square()) / (2 * deviation**2)
        means = [
            (weight * (-distance).exp() * label).sum() / (weight * (-distance).exp()).sum()
            for weight in (near, far)
        ]
        want = FIGURE_SHARE * means[0] + (1 - FIGURE_SHARE) * means[1]
        torch.testing.assert_close(found[row, column], want)


def test_without_edges_nothing_is_above_the_threshold() -> None:
    label, nothing = torch.rand(4, 4, dtype=torch.float64), torch.zeros(4, 4, dtype=torch.float64)
    assert bool(figure_threshold(label, nothing, label).isinf().all())


def test_a_floor_that_ends_at_the_sky_is_ground() -> None:
    """Its end is far away, so its edge weighs less than that of the box on it."""
    rgb, depth = _wall()
    depth[:] = 40.0
    depth[24:] = (1 / torch.linspace(1 / 25, 1 / 2, SIDE - 24))[:, None]
    rgb[24:] = FLOOR
    box = _box(30, 24, 20, 16)
    image = _with((rgb, depth), box, OBJECT, float(depth[50, 0]))
    found = figure_ground(*image).figure
    assert bool(found[32:46, 26:38].all())
    assert float(found[~grown(box, 2)].float().mean()) < 0.02


def test_edges_weigh_by_what_a_camera_disoccludes() -> None:
    depth = torch.full((9, 40), 8.0)
    depth[:, 10:20], depth[:, 30:] = 4.0, 12.0
    near, far = seeds(depth)
    # Inverse depth over its median: 2 before 1, and 1 before 2 / 3.
    assert float(near[4, 10]) == LARGEST_STEP and float(far[4, 9]) == LARGEST_STEP
    assert float(near[4, 29]) == pytest.approx(1 / 3)
    assert float(far[4, 30]) == pytest.approx(1 / 3)
    assert float(near[4, 9]) == float(far[4, 10]) == 0
