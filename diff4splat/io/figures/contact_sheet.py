"""The preview page: photograph, frames along the path, depth and coverage in one image.

Axes: ``t`` frames, ``h w`` pixels. RGB in [0, 1]; depth in the unit that is printed beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.io.figures.depth_colors import color_bar, colorize, is_flat, robust_range
from diff4splat.io.figures.page_layout import (
    FAINT,
    NOTE_INK,
    NOTE_PAPER,
    Canvas,
    Style,
    fitted,
    text_width,
    wrap,
)

_WIDTH, _MARGIN, _GAP = 1600, 40, 16
_INNER = _WIDTH - 2 * _MARGIN
_PHOTO_BOX = (720, 420)
_TITLE, _HEADING, _BODY = Style(size_px=40), Style(size_px=22), Style(size_px=20)
_FAINT, _SMALL = Style(size_px=20, color=FAINT), Style(size_px=17, color=FAINT)
_NOTE = Style(size_px=21, color=NOTE_INK)
_MAX_COLUMNS, _MIN_COLUMNS = 5, 3
_MAX_CELL_HEIGHT = 420
_MIN_STEP = 110
"""Room for a caption below very narrow images."""
_BAR = (180, 14)


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetContent:
    """What the page shows."""

    photo: Float[Tensor, "h w 3"]
    frames: Float[Tensor, "t fh fw 3"]
    depth: Float[Tensor, "t fh fw"] | None
    """None leaves the row of depth out."""
    times_s: Float[Tensor, " t"]
    alpha: Float[Tensor, "t fh fw"] | None = None
    title: str = "diff4splat"
    facts: tuple[tuple[str, str], ...] = ()
    """Pairs such as ("Gaussians", "262 144"), beside the photograph."""
    note: str | None = None
    """A warning that must not be missed, such as "untrained"."""
    depth_unit: str = "scene units"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """A stripe of the page, drawn once it is known where it starts."""

    height: int
    draw: Callable[[Canvas, int], None]


def contact_sheet(content: SheetContent) -> Float[Tensor, "h w 3"]:
    """Lay the page out; save it with ``write_png``.

    Raises:
        InputError: there are no frames.
        ShapeError: frames, depth, alpha and times do not belong together.
    """
    _require_consistent(content)
    shown = torch.linspace(0, len(content.frames) - 1, min(len(content.frames), _MAX_COLUMNS))
    index = shown.round().long().unique()
    blocks = [_head(content), _frame_row(content, index)]
    if content.depth is not None:
        blocks.append(_depth_row(content, index))
    if content.alpha is not None:
        covered = content.alpha[index][..., None].expand(-1, -1, -1, 3)
        blocks.append(_row("Coverage", covered, [""] * len(index)))
    canvas = Canvas(_WIDTH, sum(block.height + _MARGIN for block in blocks) + _MARGIN)
    y = _MARGIN
    for block in blocks:
        block.draw(canvas, y)
        y += block.height + _MARGIN
    return canvas.to_rgb()


def _require_consistent(content: SheetContent) -> None:
    want = tuple(content.frames.shape[:3])
    if want[0] == 0:
        raise InputError("contact sheet: expected at least one frame, got none")
    got = {"times_s": (*content.times_s.shape, *want[1:])}
    maps = {"depth": content.depth, "alpha": content.alpha}
    got |= {name: tuple(one.shape) for name, one in maps.items() if one is not None}
    for name, shape in got.items():
        if shape != want:
            raise ShapeError(f"contact sheet {name}: expected {want} as in frames, got {shape}")


def _head(content: SheetContent) -> _Block:
    """Photograph on the left; title, note and facts on the right."""
    size = fitted(content.photo.shape, _PHOTO_BOX)
    left = _MARGIN + size[0] + _MARGIN
    width = _WIDTH - _MARGIN - left
    note = wrap(content.note, _NOTE, width - 2 * _GAP) if content.note else []
    note_height = len(note) * _NOTE.line_px + 2 * _GAP if note else 0
    names = max((text_width(name, _FAINT) for name, _ in content.facts), default=0) + 2 * _GAP
    lines = _fact_lines(content, names, width)
    top = _TITLE.line_px + _GAP + (note_height + _GAP if note else 0)

    def draw(canvas: Canvas, y: int) -> None:
        canvas.image((_MARGIN, y), size, content.photo)
        canvas.text((left, y - 8), content.title, _TITLE)
        if note:
            canvas.box((left, y + _TITLE.line_px + _GAP), (width, note_height), NOTE_PAPER)
        for i, line in enumerate(note):
            row = y + _TITLE.line_px + 2 * _GAP + i * _NOTE.line_px
            canvas.text((left + _GAP, row), line, _NOTE)
        for i, (name, text) in enumerate(lines):
            canvas.text((left, y + top + i * _BODY.line_px), name, _FAINT)
            canvas.text((left + names, y + top + i * _BODY.line_px), text, _BODY)

    return _Block(height=max(size[1], top + len(lines) * _BODY.line_px), draw=draw)


def _fact_lines(content: SheetContent, names: int, width: int) -> list[tuple[str, str]]:
    """Name and text of every printed line; the name stands only on its first."""
    lines: list[tuple[str, str]] = []
    for name, text in content.facts:
        broken = wrap(text, _BODY, width - names)
        lines += [(name if i == 0 else "", part) for i, part in enumerate(broken)]
    return lines


def _frame_row(content: SheetContent, index: Tensor) -> _Block:
    captions = [f"{float(content.times_s[i]):.2f} s" for i in index]
    return _row("Along the path", content.frames[index], captions)


def _depth_row(content: SheetContent, index: Tensor) -> _Block:
    limits = robust_range(content.depth)
    row = _row("Depth", colorize(content.depth[index], limits), [""] * len(index))

    def draw(canvas: Canvas, y: int) -> None:
        row.draw(canvas, y)
        x = _MARGIN + text_width("Depth", _HEADING) + 2 * _GAP
        if limits is None:
            canvas.text((x, y + 4), "none in these frames", _SMALL)
            return
        if is_flat(limits):
            text = f"flat: {limits[0]:#.3g} {content.depth_unit} everywhere; grey has no depth"
            canvas.text((x, y + 4), text, _SMALL)
            return
        low, high = f"{limits[0]:#.3g}", f"{limits[1]:#.3g}"
        middle = f"{2 / (1 / limits[0] + 1 / limits[1]):#.3g}"
        canvas.text((x, y + 4), low, _SMALL)
        x += text_width(low, _SMALL) + 10
        canvas.image((x, y + 7), _BAR, color_bar(*_BAR, limits))
        x += _BAR[0] + 10
        text = f"{high} {content.depth_unit}, {middle} in the middle: even in 1 / depth"
        canvas.text((x, y + 4), f"{text}   (2 to 98 % of all pixels; grey has no depth)", _SMALL)

    return _Block(height=row.height, draw=draw)


def _row(heading: str, images: Float[Tensor, "c h w 3"], captions: list[str]) -> _Block:
    """A heading over images side by side, each with a caption below it."""
    columns = max(len(images), _MIN_COLUMNS)
    box = ((_INNER - (columns - 1) * _GAP) // columns, _MAX_CELL_HEIGHT)
    size = fitted(images.shape[1:], box)
    step = max(size[0] + _GAP, _MIN_STEP)
    top = _HEADING.line_px + 10
    caption_height = _SMALL.line_px + 8 if any(captions) else 0

    def draw(canvas: Canvas, y: int) -> None:
        canvas.text((_MARGIN, y), heading, _HEADING)
        for i, image in enumerate(images):
            x = _MARGIN + i * step
            canvas.image((x, y + top), size, image)
            canvas.text((x, y + top + size[1] + 8), captions[i], _SMALL)

    return _Block(height=top + size[1] + caption_height, draw=draw)
