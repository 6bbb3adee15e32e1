"""ImageNet's classes of nouns: ``dog`` is 118 of its 1,000 classes, ``kangaroo`` one.

``nouns.txt`` has a noun and its classes in every line (``benchmarks.named_objects.class_nouns``
writes it from WordNet 3.0, ``wordnet-license.txt``). Classes are numbered as in the weights of the
public classifier.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from types import MappingProxyType

import torch
from jaxtyping import Bool
from torch import Tensor

CLASSES = 1000
MOST_WORDS = 3
"""Of a noun that is looked for: ``hot air balloon``."""
_ENDINGS = (("ies", "y"), ("ves", "f"), ("es", ""), ("s", ""))


@cache
def classes_of_nouns() -> Mapping[str, tuple[int, ...]]:
    """The classes of every noun."""
    text = files(__package__).joinpath("nouns.txt").read_text(encoding="utf-8")
    lines = (line.split(": ") for line in text.splitlines())
    return MappingProxyType({noun: _numbers(ranges) for noun, ranges in lines})


def noun_classes(noun: str) -> tuple[int, ...]:
    """Classes of a noun in the singular or plural; empty where it has none."""
    nouns, noun = classes_of_nouns(), noun.casefold()
    singulars = (noun.removesuffix(a) + b for a, b in _ENDINGS if noun.endswith(a))
    return next((nouns[one] for one in (noun, *singulars) if one in nouns), ())


def class_rows(prompts: Sequence[tuple[int, ...]]) -> Bool[Tensor, "r k"]:
    """Which of all classes each of ``r`` prompts names."""
    rows = torch.zeros(len(prompts), CLASSES, dtype=torch.bool)
    for row, classes in zip(rows, prompts, strict=True):
        row[list(classes)] = True
    return rows


def _numbers(ranges: str) -> tuple[int, ...]:
    bounds = (part.split("-") for part in ranges.split())
    return tuple(number for ends in bounds for number in range(int(ends[0]), int(ends[-1]) + 1))
