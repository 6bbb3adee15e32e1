"""What was measured on one item, as plain numbers that go into a file and come back unchanged."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass

from diff4splat.errors import FileFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One measure of one row on one item."""

    row: str
    """The system under test, or a baseline."""
    key: str
    value: float
    parts: tuple[float | None, ...] = ()
    """Its values per judged picture, where it is their mean; None did not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Skip:
    """One measure that an item does not allow, and why; never an error of the system."""

    row: str
    key: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemResult:
    """Everything about one item."""

    item: int
    clip: str
    """Its identifier."""
    clip_sha256: str
    """Of its pictures."""
    scores: tuple[Score, ...]
    skips: tuple[Skip, ...] = ()

    def value(self, row: str, key: str) -> float | None:
        """One score, if it was taken."""
        found = (s.value for s in self.scores if s.row == row and s.key == key)
        return next(found, None)

    def to_json(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """An item that could not be measured."""

    item: int
    clip: str
    why: str


def score(row: str, key: str, values: Iterable[float]) -> Score | Skip:
    """The mean of finite ``values``, or a skip when there is none."""
    parts = tuple(float(value) for value in values)
    finite = [value for value in parts if math.isfinite(value)]
    if not finite:
        return Skip(row=row, key=key, why="no picture allows it")
    # Parts keep their place, so that they still belong to their pictures.
    kept = tuple(round(value, 6) if math.isfinite(value) else None for value in parts)
    mean = round(math.fsum(finite) / len(finite), 6)
    return Score(row=row, key=key, value=mean, parts=kept if len(parts) > 1 else ())


def read_item(record: object, where: str) -> ItemResult:
    """The item that ``to_json`` wrote.

    Raises:
        FileFormatError: something else.
    """
    try:
        scores = tuple(Score(**{**s, "parts": tuple(s["parts"])}) for s in record["scores"])
        skips = tuple(Skip(**skip) for skip in record["skips"])
        return ItemResult(**{**record, "scores": scores, "skips": skips})
    except (KeyError, TypeError) as error:
        raise FileFormatError(
            f"{where}: expected results of an evaluation, got something else; run with --fresh"
        ) from error
