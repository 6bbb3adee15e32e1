"""A map of one camera on the grid of another."""

import torch

from diff4splat.generation.layered_image.other_grid import copy_size, on_grid
from diff4splat.geometry.camera import pinhole


def test_a_grid_of_half_the_size_has_means_of_two() -> None:
    image = pinhole(8.0, (4, 6))
    ramp = torch.arange(6.0).expand(1, 4, 6)
    found, inside = on_grid(ramp, image, image.resized((2, 3)))
    torch.testing.assert_close(found[0], torch.tensor([0.5, 2.5, 4.5]).expand(2, 3))
    assert bool(inside.all())


def test_cells_outside_repeat_the_border() -> None:
    image = pinhole(8.0, (4, 6))
    ramp = torch.arange(6.0).expand(1, 4, 6)
    found, inside = on_grid(ramp, image, image.cropped((-1, -2), (6, 10)))
    want = torch.tensor([0.0, 0, 0, 1, 2, 3, 4, 5, 5, 5])
    torch.testing.assert_close(found[0, 3], want)
    assert torch.equal(inside.nonzero().amin(0), torch.tensor([1, 2]))
    assert int(inside.sum()) == 4 * 6


def test_a_copy_has_the_shape_of_the_image_and_no_more_pixels() -> None:
    assert copy_size((300, 200), 128) == (128, 85)
    assert copy_size((30, 20), 128) == (30, 20)
    assert copy_size((1000, 1), 128) == (128, 1)
