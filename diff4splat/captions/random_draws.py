"""Random numbers and choices from a generator."""

from collections.abc import Sequence
from typing import TypeVar

import torch

_LARGEST = 2**31
Word = TypeVar("Word")


def draw_share(generator: torch.Generator) -> float:
    """A number in [0, 1)."""
    return float(torch.rand((), generator=generator))


def draw_number(generator: torch.Generator) -> int:
    """A whole number from 0 to below 2³¹."""
    return int(torch.randint(_LARGEST, (), generator=generator))


def draw(words: Sequence[Word], generator: torch.Generator) -> Word:
    """One of ``words``."""
    return words[draw_number(generator) % len(words)]
