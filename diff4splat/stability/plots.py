"""What a check may show beside its numbers."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatMap:
    """Errors over two axes; cells that are not finite hold NaN or infinity."""

    title: str
    row_label: str
    rows: tuple[str, ...]
    column_label: str
    columns: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]
    """One tuple per row."""
    within_limit: tuple[tuple[bool, ...], ...]
    """Cells within the limits; the others are crossed out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """Lines over a common axis, drawn with a logarithmic y axis."""

    title: str
    x_label: str
    x: tuple[float, ...]
    y_label: str
    lines: tuple[tuple[str, tuple[float, ...]], ...]
    """(name, y values)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thumbnail:
    """A small image."""

    caption: str
    rgb: Float[Tensor, "h w 3"]
    """In [0, 1]; other numbers are clamped, NaN is drawn in magenta."""


Plot = HeatMap | Curves | Thumbnail
