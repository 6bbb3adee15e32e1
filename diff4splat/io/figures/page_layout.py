"""A page to put images and short texts on; positions are (x, y) pixels from the top left."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image, ImageDraw
from torch import Tensor

from diff4splat.io.figures.fonts import BOX_EM, run_width, runs
from diff4splat.io.pixels import from_bytes, to_bytes
from diff4splat.progress.plain_text import plain_text

BACKGROUND, INK, FAINT = (22, 24, 29), (236, 238, 242), (154, 160, 172)
FRAME, NOTE_PAPER, NOTE_INK = (48, 52, 62), (64, 46, 12), (255, 205, 112)

Color = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How a text looks."""

    size_px: int = 20
    color: Color = INK

    @property
    def line_px(self) -> int:
        """Distance from one line to the next."""
        return round(self.size_px * 1.4)


def text_width(text: str, style: Style) -> int:
    """Pixels that one line takes."""
    parts = runs(plain_text(text), style.size_px)
    return math.ceil(math.fsum(run_width(font, part, style.size_px) for font, part in parts))


def wrap(text: str, style: Style, width: int) -> list[str]:
    """Lines no wider than ``width``, broken at spaces, and inside words that are too long."""
    lines = [""]
    for word in text.split():
        if lines[-1] and text_width(f"{lines[-1]} {word}", style) <= width:
            lines[-1] += f" {word}"
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, style) > width:
                lines.append("")
            lines[-1] += letter
    return lines


class Canvas:
    """The page while it is being drawn."""

    def __init__(self, width: int, height: int) -> None:
        self._image = Image.new("RGB", (width, height), BACKGROUND)
        self._draw = ImageDraw.Draw(self._image)

    def text(self, position: tuple[int, int], text: str, style: Style) -> None:
        """One line; ``position`` is the top left of its letters."""
        x, y = float(position[0]), position[1]
        for font, part in runs(plain_text(text), style.size_px):
            if font is None:
                self._boxes((x, y), len(part), style)
            else:
                self._draw.text((x, y), part, fill=style.color, font=font)
            x += run_width(font, part, style.size_px)

    def _boxes(self, position: tuple[float, int], count: int, style: Style) -> None:
        """Characters that no font has."""
        size_px, (x, y) = style.size_px, position
        for index in range(count):
            left = x + BOX_EM * size_px * index + 1
            corners = (left, y + 0.25 * size_px, left + (BOX_EM * size_px - 3), y + size_px)
            self._draw.rectangle(corners, outline=style.color)

    def box(self, position: tuple[int, int], size: tuple[int, int], color: Color) -> None:
        """A filled rectangle with round corners; ``size`` is (width, height)."""
        corner = (position[0] + size[0] - 1, position[1] + size[1] - 1)
        self._draw.rounded_rectangle((*position, *corner), radius=6, fill=color)

    def image(
        self, position: tuple[int, int], size: tuple[int, int], rgb: Float[Tensor, "h w 3"]
    ) -> None:
        """An image scaled to ``size`` (width, height) with a thin frame just outside."""
        x, y = position
        self._draw.rectangle((x - 1, y - 1, x + size[0], y + size[1]), outline=FRAME)
        scaled = Image.fromarray(to_bytes(rgb)).resize(size, Image.Resampling.LANCZOS)
        self._image.paste(scaled, position)

    def to_rgb(self) -> Float[Tensor, "h w 3"]:
        """The finished page."""
        return from_bytes(np.asarray(self._image))


def fitted(shape: torch.Size, box: tuple[int, int]) -> tuple[int, int]:
    """The largest (width, height) inside ``box`` for an image of shape (height, width, ...)."""
    height, width = shape[:2]
    factor = min(box[0] / width, box[1] / height)
    return max(round(width * factor), 1), max(round(height * factor), 1)
