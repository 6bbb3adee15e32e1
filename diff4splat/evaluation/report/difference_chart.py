"""Bar chart of per-item differences to the best baseline, worst item on the left.

Axes: ``h w`` pixels. Needs no plotting library.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.io.figures.page_layout import FAINT, Canvas, Style

_SIZE, _MARGIN, _PLOT_HEIGHT = (960, 420), 40, 280
_BETTER, _WORSE, _PAPER, _AXIS = (0.34, 0.71, 0.91), (0.84, 0.37, 0.0), 0.1, 0.6
"""Colours of Okabe and Ito, distinguishable with any colour vision."""


def difference_chart(values: list[float], title: str) -> Float[Tensor, "h w 3"]:
    """Sorted bars around a line at 0, with the extreme values below."""
    canvas = Canvas(*_SIZE)
    canvas.text((_MARGIN, 16), title, Style(size_px=20))
    width = _SIZE[0] - 2 * _MARGIN
    canvas.image((_MARGIN, 64), (width, _PLOT_HEIGHT), _bars(sorted(values), width))
    below = 64 + _PLOT_HEIGHT + 12
    small = Style(size_px=17, color=FAINT)
    if values:
        wins = sum(value > 0 for value in values)
        text = (
            f"{len(values)} items, better on {wins}; from {min(values):+.3g} to {max(values):+.3g}"
        )
        canvas.text((_MARGIN, below), text, small)
    else:
        canvas.text((_MARGIN, below), "no item has both values", small)
    return canvas.to_rgb()


def _bars(values: list[float], width: int) -> Float[Tensor, "h w 3"]:
    image = torch.full((_PLOT_HEIGHT, width, 3), _PAPER)
    largest = max((abs(value) for value in values), default=0.0) or 1.0
    middle = _PLOT_HEIGHT // 2
    for index, value in enumerate(values):
        left, right = (round(width * place / len(values)) for place in (index, index + 1))
        inner = slice(left, max(right - 1, left + 1))
        reach = round(abs(value) / largest * (middle - 8))
        rows = slice(middle - reach, middle) if value > 0 else slice(middle, middle + reach)
        image[rows, inner] = torch.tensor(_BETTER if value > 0 else _WORSE)
    image[middle] = _AXIS
    return image
