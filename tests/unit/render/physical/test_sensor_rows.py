"""Times of lines: the values of 4D-GRT's own tests, all directions, chunks that end early."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_chunks import chunk_pixels, chunks, constant_error_px
from oracles_physical import line_share

from diff4splat.render.physical.sensor_rows import line_count, line_of, line_shares

DIRECTIONS = ("top-to-bottom", "bottom-to-top", "left-to-right", "right-to-left")


def test_five_columns_in_chunks_of_three() -> None:
    first, last = chunks(5, 3, "left-to-right")
    assert (first.share, last.share) == (0.25, 0.875)
    assert chunk_pixels(first, (2, 5), "left-to-right").tolist() == [0, 1, 2, 5, 6, 7]
    assert chunk_pixels(last, (2, 5), "left-to-right").tolist() == [3, 4, 8, 9]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_lone_line_is_read_in_the_middle(direction: str) -> None:
    assert line_shares(1, direction).tolist() == [0.5]
    assert [chunk.share for chunk in chunks(1, 4, direction)] == [0.5]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_shares_are_those_of_the_formula(direction: str) -> None:
    size_px = (4, 7)
    pixels = torch.arange(28)
    shares = line_shares(line_count(size_px, direction), direction)
    made = shares[line_of(pixels, size_px, direction)].tolist()
    want = [line_share(row, column, size_px, direction) for row in range(4) for column in range(7)]
    assert made == pytest.approx(want, abs=1e-15)
    assert (min(made), max(made)) == (0.0, 1.0)


def test_reverse_order_starts_with_the_last_line() -> None:
    assert line_shares(5, "bottom-to-top").tolist() == [1.0, 0.75, 0.5, 0.25, 0.0]
    first, last = chunks(5, 3, "bottom-to-top")
    assert (first.lines, last.lines) == (range(3), range(3, 5))
    assert (first.share, last.share) == (0.75, 0.125)


@given(
    size=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    lines=st.integers(1, 12),
    direction=st.sampled_from(DIRECTIONS),
)
@settings(max_examples=40, deadline=None)
def test_chunks_hold_every_pixel_once(size: tuple[int, int], lines: int, direction: str) -> None:
    made = chunks(line_count(size, direction), lines, direction)
    pixels = torch.cat([chunk_pixels(chunk, size, direction) for chunk in made])
    assert pixels.sort().values.tolist() == list(range(size[0] * size[1]))


def test_the_error_of_chunks_that_stand_is_half_a_chunk() -> None:
    # 20 px per frame and six of 512 rows: just below a tenth of a pixel.
    assert constant_error_px(20.0, 6, 1.0, 512) == pytest.approx(20 * 5 / (2 * 511))
    assert constant_error_px(20.0, 1, 1.0, 512) == 0.0
    assert constant_error_px(20.0, 1, 1.0, 1) == 0.0
