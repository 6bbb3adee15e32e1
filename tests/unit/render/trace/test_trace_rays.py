"""What rays must be, and what becomes of them."""

import math

import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.render.trace.rays import Rays


def rays(directions: list, **others: torch.Tensor) -> Rays:
    toward = torch.tensor(directions)
    return Rays(origins=torch.zeros_like(toward), directions=toward, **others)


@pytest.mark.parametrize("size", [1e-38, 1e-20, 1.0, 3.0, 1e20, 1e38])
def test_directions_of_any_length_become_unit(size: float) -> None:
    made = rays([[size, 0.0, -size]]).directions
    half = math.sqrt(0.5)
    torch.testing.assert_close(made, torch.tensor([[half, 0.0, -half]]))


def test_normalising_has_its_gradient() -> None:
    toward = torch.tensor([[0.3, -0.4, 2.0], [5.0, 1.0, 0.1]], dtype=torch.float64)

    def directions(values: torch.Tensor) -> torch.Tensor:
        return Rays(origins=torch.zeros_like(values), directions=values).directions

    assert torch.autograd.gradcheck(directions, toward.requires_grad_())


def test_a_direction_of_zero_is_refused() -> None:
    with pytest.raises(InputError, match=r"Rays.directions: expected lengths above 0"):
        rays([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="expected finite"):
        rays([[bad, 0.0, 1.0]])
    with pytest.raises(InputError, match="expected finite"):
        rays([[0.0, 0.0, 1.0]], time_s=torch.tensor([bad]))


def test_rays_that_do_not_exist_may_hold_anything() -> None:
    made = rays(
        [[math.nan, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 3.0, 4.0]],
        valid=torch.tensor([False, False, True]),
        time_s=torch.tensor([math.inf, 0.0, 1.0]),
    )
    assert bool(torch.isfinite(made.directions).all())
    assert made.directions[2].tolist() == pytest.approx([0.0, 0.6, 0.8])
    assert made.time_s.tolist() == [0.0, 0.0, 1.0]


def test_selecting_keeps_what_there_is() -> None:
    made = rays([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], time_s=torch.tensor([1.0, 2.0]))
    one = made.select(torch.tensor([1]))
    assert len(one) == 1
    assert one.valid is None
    assert one.time_s.tolist() == [2.0]


@pytest.mark.usefixtures("as_shipped")
def test_shapes_that_do_not_fit_are_refused() -> None:
    three = torch.ones(2, 3)
    with pytest.raises(ShapeError, match=r"Rays.directions: expected \(2, 3\), got \(1, 3\)"):
        Rays(origins=three, directions=three[:1])
    with pytest.raises(ShapeError, match=r"Rays.time_s: expected \(2,\), got \(3,\)"):
        Rays(origins=three, directions=three, time_s=torch.zeros(3))
    with pytest.raises(ShapeError, match="expected one dtype"):
        Rays(origins=three, directions=three.double())
    with pytest.raises(ShapeError, match="float32 or float64"):
        Rays(origins=three.half(), directions=three.half())
