"""Pixels at an outline whose colours are none of the object's."""

import torch
from torch import Tensor

from diff4splat.generation.motion.local_motion.mixed_rim import has_other_color

SIDE, MIXED_PX = 32, 2
INSIDE = torch.zeros(SIDE, SIDE, dtype=torch.bool)
INSIDE[4:28, 4:28] = True


def colored(value: float) -> Tensor:
    return torch.full((SIDE, SIDE, 3), value)


def test_greenish_pixels_of_an_even_object_are_found() -> None:
    rgb = colored(0.5)
    rgb[4, 4:28, 1] = 0.9
    found = has_other_color(rgb, INSIDE, colored(0.5), MIXED_PX)
    assert bool(found[4, 4:28].all()) and int(found.sum()) == 24


def test_colours_that_the_interior_has_near_by_stay() -> None:
    rgb = colored(0.5)
    rgb[::2] = 0.9
    assert not has_other_color(rgb, INSIDE, colored(0.5), MIXED_PX).any()


def test_the_same_colours_far_away_are_no_reason() -> None:
    rgb = colored(0.5)
    rgb[4, 4:28], rgb[24, 8:24] = 0.9, 0.9
    assert bool(has_other_color(rgb, INSIDE, colored(0.5), MIXED_PX)[4, 4:28].all())


def test_an_object_without_pixels_has_no_rim() -> None:
    nothing = torch.zeros_like(INSIDE)
    assert not has_other_color(colored(0.5), nothing, colored(0.9), MIXED_PX).any()


def test_outside_nothing_is_found() -> None:
    rgb = torch.where(INSIDE[..., None], colored(0.5), colored(1.0))
    assert not has_other_color(rgb, INSIDE, colored(0.5), MIXED_PX).any()


def test_an_object_that_is_all_outline_is_compared_with_what_it_is_given() -> None:
    thin = torch.zeros_like(INSIDE)
    thin[10, 4:28] = True
    assert int(has_other_color(colored(0.5), thin, colored(0.9), MIXED_PX).sum()) == 24
    assert not has_other_color(colored(0.5), thin, colored(0.5), MIXED_PX).any()
