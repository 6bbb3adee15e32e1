"""Truth, scene and their difference side by side, one row per frame.

Axes: ``h w`` pixels. RGB in [0, 1]; differences are shown four times as large.
"""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor

from diff4splat.io.figures.page_layout import Canvas, Style, fitted

GAIN = 4.0
_CELL_PX, _GAP_PX, _MARGIN_PX, _LABEL_PX = 360, 12, 24, 34
_TITLES = ("truth", "scene", f"difference x {GAIN:g}")


def comparison(
    truths: Sequence[Float[Tensor, "h w 3"]],
    made: Sequence[Float[Tensor, "h w 3"]],
    labels: Sequence[str],
) -> Float[Tensor, "sh sw 3"]:
    """The sheet; pictures of any size are fitted into cells."""
    size = fitted(truths[0].shape, (_CELL_PX, _CELL_PX))
    row_px = size[1] + _LABEL_PX
    width = 2 * _MARGIN_PX + 3 * _CELL_PX + 2 * _GAP_PX
    canvas = Canvas(width, 2 * _MARGIN_PX + _LABEL_PX + row_px * len(truths))
    for column, title in enumerate(_TITLES):
        canvas.text((_column_x(column), _MARGIN_PX), title, Style(size_px=20))
    for row, (truth, picture, label) in enumerate(zip(truths, made, labels, strict=True)):
        top = _MARGIN_PX + _LABEL_PX + row * row_px
        apart = ((picture - truth).abs() * GAIN).clamp(0, 1)
        for column, shown in enumerate((truth, picture, apart)):
            canvas.picture((_column_x(column), top), size, shown)
        canvas.text((_column_x(0), top + size[1] + 4), label, Style(size_px=18))
    return canvas.to_rgb()


def _column_x(column: int) -> int:
    return _MARGIN_PX + column * (_CELL_PX + _GAP_PX)
