"""Shapes of a graph's tensors: whole numbers, or linear expressions of named sizes.

``["batch", 3, "4*packs+1", "16*rows", "16*columns"]`` is a video of 1 + 4 k frames with sides that
are multiples of 16 px. A name stands for one size, at least 1, in all inputs of a graph.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from diff4splat.errors import FileFormatError, ShapeError

Axis = int | str
_EXPRESSION = re.compile(r"(?:(\d{1,6})\*)?([a-z][a-z_]{0,31})(?:\+(\d{1,6}))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSize:
    """factor · name + offset."""

    name: str
    factor: int = 1
    offset: int = 0
    least: int = 1
    """Of the named size."""

    def length(self, size: int) -> int:
        """The length of an axis for a named ``size``."""
        return self.factor * size + self.offset

    def solve(self, length: int) -> int | None:
        """The named size that gives ``length``; None where there is none."""
        size, remainder = divmod(length - self.offset, self.factor)
        return size if remainder == 0 and size >= self.least else None


def parse_axis(axis: Axis) -> int | LinearSize:
    """A whole number as it is, an expression taken apart.

    Raises:
        FileFormatError: neither.
    """
    if isinstance(axis, int) and not isinstance(axis, bool) and axis >= 0:
        return axis
    match = _EXPRESSION.fullmatch(axis) if isinstance(axis, str) else None
    if match is None or match[1] == "0":
        raise FileFormatError(f"shape: expected a length or factor*name+offset, got {axis!r}")
    offset = int(match[3] or 0)
    # Frames are 1 + 4 k with k = 0 for a single image.
    least = 0 if offset else 1
    return LinearSize(name=match[2], factor=int(match[1] or 1), offset=offset, least=least)


def shape_of(shape: Sequence[Axis], sizes: Mapping[str, int]) -> tuple[int, ...]:
    """Lengths of a tensor for the named ``sizes``."""
    lengths = []
    for parsed in map(parse_axis, shape):
        linear = isinstance(parsed, LinearSize)
        lengths.append(parsed.length(sizes[parsed.name]) if linear else parsed)
    return tuple(lengths)


def match_shape(
    name: str, shape: Sequence[Axis], got: Sequence[int], sizes: dict[str, int]
) -> None:
    """Compare one input's shape, and add what it tells of the named sizes to ``sizes``.

    Raises:
        ShapeError: the shape does not fit, or contradicts a size that is known.
    """
    fits = len(shape) == len(got)
    for axis, length in zip(map(parse_axis, shape), got, strict=False):
        if isinstance(axis, int):
            fits = fits and axis == length
            continue
        size = axis.solve(length)
        fits = fits and size is not None and sizes.setdefault(axis.name, size) == size
    if not fits:
        known = ", ".join(f"{key} {value}" for key, value in sizes.items())
        raise ShapeError(
            f"{name}: expected the shape [{', '.join(map(str, shape))}], got {list(got)}"
            + (f" with {known}" if known else "")
        )
