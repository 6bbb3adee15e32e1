"""Text files with one camera per line and blanks between the numbers."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.checks import finite_numbers, require_pose_count
from diff4splat.paths.limits import MAX_POSES


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """The numbers of a file (float64), and which line each row stood on."""

    rows: Float[Tensor, "t c"]
    labels: list[str]


def data_lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and words, without empty lines and ``#`` comments."""
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words and not words[0].startswith("#"):
            yield number, words


def is_heading(words: list[str]) -> bool:
    """Whether a first line is a title or an address and not a row: most of it is not numbers."""
    return 2 * sum(_is_number(word) for word in words) < len(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def read_table(text: str, columns: int, name: str, layout: str) -> TextTable:
    """Rows of exactly ``columns`` numbers; a heading is skipped.

    Raises:
        FileFormatError: naming the line, what was expected (``layout``) and what was found.
    """
    # A heading and one pose too many are enough to know.
    lines = list(islice(data_lines(text), MAX_POSES + 2))
    if lines and is_heading(lines[0][1]):
        lines = lines[1:]
    require_pose_count(len(lines), name)
    rows = []
    for number, words in lines:
        where = f"{name}: line {number}"
        if len(words) != columns:
            raise FileFormatError(
                f"{where}: expected {columns} columns ({layout}), got {len(words)}; repair the line"
            )
        rows.append(finite_numbers(words, where))
    labels = [f"line {number}" for number, _ in lines]
    return TextTable(rows=torch.tensor(rows, dtype=torch.float64), labels=labels)
