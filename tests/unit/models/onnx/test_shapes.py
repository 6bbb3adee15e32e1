"""Shapes with named sizes: what fits, what does not, and that a match gives the lengths back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError, ShapeError
from diff4splat.models.onnx.shapes import match_shape, parse_axis, shape_of

VIDEO = ("batch", 3, "4*packs+1", "16*rows", "16*columns")


@given(st.integers(1, 9), st.integers(0, 9), st.integers(1, 99), st.integers(1, 99))
def test_a_match_is_the_inverse_of_a_shape(batch: int, packs: int, rows: int, columns: int) -> None:
    sizes = {"batch": batch, "packs": packs, "rows": rows, "columns": columns}
    found: dict[str, int] = {}
    match_shape("video", VIDEO, shape_of(VIDEO, sizes), found)
    assert found == sizes


@pytest.mark.parametrize(
    "got",
    [
        (1, 3, 5, 32, 24),
        (1, 3, 4, 32, 32),
        (1, 4, 5, 32, 32),
        (0, 3, 5, 32, 32),
        (1, 3, 5, 0, 32),
        (1, 3, 5, 32),
        (1, 3, 5, 32, 32, 1),
        (),
    ],
)
def test_what_the_network_refuses_is_refused(got: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match=r"video: expected the shape \[batch, 3, 4\*packs\+1"):
        match_shape("video", VIDEO, got, {})


def test_one_name_is_one_size_in_all_inputs() -> None:
    sizes: dict[str, int] = {}
    match_shape("video", VIDEO, (1, 3, 5, 32, 48), sizes)
    with pytest.raises(ShapeError, match="with batch 1, packs 1, rows 2, columns 3"):
        match_shape("latent", ("batch", "packs+1", "rows"), (1, 2, 3), sizes)


@pytest.mark.parametrize("axis", ["", "0*rows", "rows*2", "-1", -1, 2.0, True, None, "Rows", "a+b"])
def test_other_expressions_are_damage(axis: object, as_shipped: None) -> None:
    with pytest.raises(FileFormatError, match="shape: expected"):
        parse_axis(axis)
