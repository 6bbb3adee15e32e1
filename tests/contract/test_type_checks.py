"""The checks that tests put on every function find wrong types and shapes, and then stand aside."""

import pytest
import torch
from jaxtyping import Float, TypeCheckError
from torch import Tensor
from type_checks import CHECKED_CALLS, check_first_calls, check_types

from diff4splat.geometry.camera import pinhole


def add(left: Float[Tensor, "n"], right: Float[Tensor, "n"]) -> Tensor:
    return torch.cat([left, right])


def test_the_package_is_checked() -> None:
    assert pinhole.__code__.co_filename == check_first_calls.__code__.co_filename


def test_shapes_are_checked_in_the_first_calls_only() -> None:
    checked = check_first_calls(add, typechecker=check_types)
    for _ in range(CHECKED_CALLS):
        with pytest.raises(TypeCheckError):
            checked(torch.ones(2), torch.ones(3))
    assert checked(torch.ones(2), torch.ones(3)).shape == (5,)


def test_functions_inside_functions_are_left_alone() -> None:
    def inner(value: int) -> int:
        return value

    assert check_first_calls(inner, typechecker=check_types) is inner
