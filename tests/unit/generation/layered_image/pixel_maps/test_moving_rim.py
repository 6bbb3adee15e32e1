"""Mixed pixels beside what moves go along; those of the background stay."""

import pytest
import torch
from image_layers import GREEN, RED, RIM_SIZE_PX, square_mask
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.moving_rim import with_moving_rim

MASK, MIXED = square_mask(8, 16), square_mask(7, 17) & ~square_mask(8, 16)


def _image(share: float) -> Tensor:
    """``share`` of the object in every pixel beside it."""
    image = torch.where(MASK[..., None], RED, GREEN)
    image[MIXED] = share * RED + (1 - share) * GREEN
    return image


def _maps() -> tuple[Tensor, Tensor]:
    displacement = torch.zeros(2, *RIM_SIZE_PX, 3)
    displacement[1, MASK] = torch.tensor([1.0, 0.0, 0.5])
    return torch.where(MASK, 3.0, 20.0), displacement


@pytest.mark.parametrize(("share", "joins"), [(0.4, True), (0.1, False)])
def test_pixels_that_show_a_bit_of_the_object_move_with_it(share: float, joins: bool) -> None:
    depth, displacement = with_moving_rim(*_maps(), _image(share))
    moving = displacement[1].any(-1)
    assert torch.equal(moving, MASK | MIXED if joins else MASK)
    assert bool((depth[moving] == 3.0).all()) and bool((depth[~moving] == 20.0).all())
    assert bool((displacement[1, moving] == torch.tensor([1.0, 0.0, 0.5])).all())
    assert not bool(displacement[0].any())


def test_dark_pixels_with_the_tint_of_the_object_move_with_it() -> None:
    """As JPEG makes them: the chroma of both, the brightness of the background alone."""
    image = 0.3 * _image(0.4)
    image[MASK] += 0.6
    _, displacement = with_moving_rim(*_maps(), image)
    assert torch.equal(displacement[1].any(-1), MASK | MIXED)


@pytest.mark.parametrize("moving", [False, True])
def test_nothing_changes_where_nothing_or_everything_moves(moving: bool) -> None:
    depth, displacement = (
        torch.rand(RIM_SIZE_PX) + 1,
        torch.full((2, *RIM_SIZE_PX, 3), float(moving)),
    )
    found = with_moving_rim(depth, displacement, torch.rand(*RIM_SIZE_PX, 3))
    assert torch.equal(found[0], depth) and torch.equal(found[1], displacement)


def test_one_pixel_that_moves() -> None:
    displacement = torch.zeros(1, 2, 2, 3)
    displacement[0, 0, 0] = 1
    depth, found = with_moving_rim(torch.ones(2, 2), displacement, torch.rand(2, 2, 3))
    assert bool(depth.isfinite().all()) and bool(found.isfinite().all())
