"""The contact sheet of a data set: one row of frames per effect, at the same times.

Axes: ``h w`` pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.io.figures.page_layout import FAINT, Canvas, Style, fitted, text_width, wrap

_MARGIN, _GAP = 40, 16
_BOX = (290, 290)
_TITLE, _HEADING = Style(size_px=40), Style(size_px=22)
_SMALL = Style(size_px=17, color=FAINT)
_LEAST_COLUMNS = 3

Image = Float[Tensor, "h w 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetRow:
    """One sequence."""

    name: str
    facts: str
    images: tuple[tuple[float, Image], ...]
    """(seconds, image)"""


def camera_sheet(rows: Sequence[SheetRow], license: str) -> Image:
    """The page."""
    columns = max(_LEAST_COLUMNS, *(len(row.images) for row in rows))
    width = 2 * _MARGIN + columns * (_BOX[0] + _GAP) - _GAP
    facts = [wrap(row.facts, _SMALL, width - 2 * _MARGIN - _name_width(rows)) for row in rows]
    top = _MARGIN + _TITLE.line_px + _SMALL.line_px + _GAP
    heights = [_height(row, lines) for row, lines in zip(rows, facts, strict=True)]
    canvas = Canvas(width, top + sum(heights) + _MARGIN)
    canvas.text((_MARGIN, _MARGIN - 8), "Physical cameras", _TITLE)
    canvas.text((_MARGIN, _MARGIN + _TITLE.line_px), f"licence of the scene: {license}", _SMALL)
    for row, lines, height in zip(rows, facts, heights, strict=True):
        _draw(canvas, top, row, lines, _name_width(rows))
        top += height
    return canvas.to_rgb()


def thumbnail(rgb: Image) -> Image:
    """A copy no larger than the page needs."""
    width, height = fitted(rgb.shape, _BOX)
    if height >= rgb.shape[0]:
        return rgb.detach().cpu()
    small = torch.nn.functional.interpolate(
        rgb.detach().cpu().permute(2, 0, 1)[None].float(), (height, width), mode="area"
    )
    return small[0].permute(1, 2, 0)


def _draw(canvas: Canvas, y: int, row: SheetRow, facts: list[str], indent: int) -> None:
    canvas.text((_MARGIN, y), row.name, _HEADING)
    for number, line in enumerate(facts):
        canvas.text((_MARGIN + indent, y + 4 + number * _SMALL.line_px), line, _SMALL)
    top = y + _head_height(facts)
    for column, (time_s, image) in enumerate(row.images):
        x, size = _MARGIN + column * (_BOX[0] + _GAP), fitted(image.shape, _BOX)
        canvas.image((x, top), size, image)
        canvas.text((x, top + size[1] + 8), f"{time_s:.3f} s", _SMALL)


def _height(row: SheetRow, facts: list[str]) -> int:
    tallest = max(fitted(image.shape, _BOX)[1] for _, image in row.images)
    return _head_height(facts) + tallest + _SMALL.line_px + 8 + _MARGIN


def _head_height(facts: list[str]) -> int:
    return max(_HEADING.line_px, 4 + len(facts) * _SMALL.line_px) + 10


def _name_width(rows: Sequence[SheetRow]) -> int:
    return max(text_width(row.name, _HEADING) for row in rows) + 2 * _GAP
