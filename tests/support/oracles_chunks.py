"""Chunks of lines as published code reads them: each stands still at the mean of its row times."""

from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.geometry.optics import Direction
from diff4splat.render.physical.sensor_rows import line_of, line_shares


@dataclass(frozen=True, slots=True)
class Chunk:
    """Neighbouring lines that are seen as if they were read at one time."""

    lines: range
    """In the order of the image."""
    share: float
    """The mean of their shares of the read-out."""


def chunks(count: int, lines_per_chunk: int, direction: Direction) -> list[Chunk]:
    """All lines in chunks, the last of which may be smaller."""
    shares = line_shares(count, direction)
    starts = range(0, count, lines_per_chunk)
    ranges = [range(start, min(start + lines_per_chunk, count)) for start in starts]
    return [Chunk(lines, float(shares[lines.start : lines.stop].mean())) for lines in ranges]


def chunk_pixels(chunk: Chunk, size_px: tuple[int, int], direction: Direction) -> Tensor:
    """Flat indices of the pixels of a chunk, row by row."""
    every = torch.arange(size_px[0] * size_px[1])
    lines = line_of(every, size_px, direction)
    return every[(lines >= chunk.lines.start) & (lines < chunk.lines.stop)]


def constant_error_px(speed_px: float, lines_per_chunk: int, readout: float, count: int) -> float:
    """Largest error of a chunk that stands at its mean time, for something that moves.

    ``speed_px`` is in pixels per unit of time, ``readout`` in that unit.
    """
    return speed_px * (lines_per_chunk - 1) * readout / (2 * max(count - 1, 1))
