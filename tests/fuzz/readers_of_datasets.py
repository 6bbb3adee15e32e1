"""Training data sets: a small copy of each, of which every clip is read."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from toy_datasets import TOYS, ToySet, read_clips

from fuzz.reader import Reader

_LEFT_OUT = ("matrixcity float", "matrixcity packaged")
"""Other kinds of a format whose half kind is here."""


def _make(toy: ToySet, folder: Path) -> None:
    (folder / "copy").mkdir()
    toy.write(toy.truth(), folder / "copy")


def _reading(toy: ToySet) -> Callable[[Path], object]:
    return lambda folder: read_clips(toy.dataset, folder / "copy")


DATASETS = {
    f"data set {toy.dataset}": Reader(make=partial(_make, toy), read=_reading(toy))
    for name, toy in TOYS.items()
    if name not in _LEFT_OUT
}
