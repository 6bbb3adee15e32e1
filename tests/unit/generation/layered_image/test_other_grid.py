"""A map of one camera on the grid of another."""

import torch

from diff4splat.generation.layered_image.other_grid import on_grid
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
