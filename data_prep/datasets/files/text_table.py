"""Text files with rows of numbers, such as poses."""

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_text


def number_rows(file: Path, columns: int, header: int = 0) -> Float64[np.ndarray, "r c"]:
    """All rows of a file of ``columns`` numbers per row, after ``header`` lines.

    Raises:
        FileFormatError: missing, not text, or a row with other than ``columns`` finite numbers.
    """
    lines = read_text(file, "a text file of numbers").splitlines()[header:]
    rows = [
        numbers(line, columns, f"{file}, line {place}")
        for place, line in enumerate(lines, header + 1)
        if line.strip()
    ]
    if not rows:
        raise FileFormatError(
            f"{file}: expected rows of {columns} numbers, got none; copy it again"
        )
    return np.array(rows)


def numbers(line: str, columns: int, where: str) -> list[float]:
    """The numbers of one line.

    Raises:
        FileFormatError: not ``columns`` finite numbers.
    """
    parts = line.replace(",", " ").split()
    try:
        values = [float(part) for part in parts]
    except ValueError:
        raise FileFormatError(
            f"{where}: expected {columns} numbers, got {line.strip()[:60]!r}; copy it again"
        ) from None
    if len(values) != columns or not all(map(math.isfinite, values)):
        raise FileFormatError(
            f"{where}: expected {columns} finite numbers, got {len(values)}: "
            f"{line.strip()[:60]!r}; copy it again"
        )
    return values
