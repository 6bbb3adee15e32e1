"""A sheet of ground truth, rendering and difference, one row per frame.

Axes: ``h w`` pixels. RGB in [0, 1]; differences are amplified by ``DIFFERENCE_GAIN``.
"""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor

from diff4splat.io.figures.page_layout import Canvas, Style, fitted

DIFFERENCE_GAIN = 4.0
_CELL_PX, _GAP_PX, _MARGIN_PX, _LABEL_PX = 360, 12, 24, 34
_TITLES = ("truth", "scene", f"difference x {DIFFERENCE_GAIN:g}")


def comparison_sheet(
    truths: Sequence[Float[Tensor, "h w 3"]],
    renderings: Sequence[Float[Tensor, "h w 3"]],
    labels: Sequence[str],
) -> Float[Tensor, "sh sw 3"]:
    """Draw the sheet; images of any size are scaled to the cells."""
    size = fitted(truths[0].shape, (_CELL_PX, _CELL_PX))
    row_px = size[1] + _LABEL_PX
    width = 2 * _MARGIN_PX + 3 * _CELL_PX + 2 * _GAP_PX
    canvas = Canvas(width, 2 * _MARGIN_PX + _LABEL_PX + row_px * len(truths))
    for column, title in enumerate(_TITLES):
        canvas.text((_column_x(column), _MARGIN_PX), title, Style(size_px=20))
    for row, (truth, rendering, label) in enumerate(zip(truths, renderings, labels, strict=True)):
        top = _MARGIN_PX + _LABEL_PX + row * row_px
        difference = ((rendering - truth).abs() * DIFFERENCE_GAIN).clamp(0, 1)
        for column, image in enumerate((truth, rendering, difference)):
            canvas.image((_column_x(column), top), size, image)
        canvas.text((_column_x(0), top + size[1] + 4), label, Style(size_px=18))
    return canvas.to_rgb()


def _column_x(column: int) -> int:
    return _MARGIN_PX + column * (_CELL_PX + _GAP_PX)
