"""Results of one item as plain numbers, with a lossless JSON form."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass

from diff4splat.errors import FileFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Value of one metric for one row of one item."""

    row: str
    """The system or a baseline."""
    key: str
    value: float
    parts: tuple[float | None, ...] = ()
    """Values per target image if ``value`` is their mean; None is not counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Skip:
    """A metric that is undefined for an item, and why; never an error of the system."""

    row: str
    key: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Embedding:
    """Features of the video of one row, for distances of distributions."""

    row: str
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemResult:
    """All results of one item."""

    item: int
    clip: str
    """Identifier of the clip."""
    clip_sha256: str
    """Hash of the images of the clip."""
    scores: tuple[Score, ...]
    skips: tuple[Skip, ...] = ()
    embeddings: tuple[Embedding, ...] = ()

    def value(self, row: str, key: str) -> float | None:
        """One score; None if it is missing."""
        values = (s.value for s in self.scores if s.row == row and s.key == key)
        return next(values, None)

    def embedding(self, row: str) -> tuple[float, ...] | None:
        """Features of one row; None if it has no video."""
        return next((e.values for e in self.embeddings if e.row == row), None)

    def to_json(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """An item whose measurement failed."""

    item: int
    clip: str
    why: str


def score(row: str, key: str, values: Iterable[float]) -> Score | Skip:
    """The mean of the finite ``values``; a skip if no value is finite."""
    parts = tuple(float(value) for value in values)
    finite = [value for value in parts if math.isfinite(value)]
    if not finite:
        return Skip(row=row, key=key, why="no image allows it")
    # Parts keep their index, so that they still belong to their images.
    rounded = tuple(round(value, 6) if math.isfinite(value) else None for value in parts)
    mean = round(math.fsum(finite) / len(finite), 6)
    return Score(row=row, key=key, value=mean, parts=rounded if len(parts) > 1 else ())


def read_item(record: object, where: str) -> ItemResult:
    """Read an item that ``to_json`` wrote.

    Raises:
        FileFormatError: the record has another structure.
    """
    try:
        scores = tuple(Score(**{**s, "parts": tuple(s["parts"])}) for s in record["scores"])
        skips = tuple(Skip(**skip) for skip in record["skips"])
        embeddings = tuple(
            Embedding(row=e["row"], values=tuple(e["values"])) for e in record.get("embeddings", ())
        )
        parts = {"scores": scores, "skips": skips, "embeddings": embeddings}
        result = ItemResult(**{**record, **parts})
        if not _is_plain(result):
            raise TypeError("values of other types")
        return result
    except (AttributeError, KeyError, TypeError) as error:
        raise FileFormatError(
            f"{where}: expected results of an evaluation, got something else; run with --fresh"
        ) from error


def _is_plain(result: ItemResult) -> bool:
    """Whether every field has its type; dataclasses do not look."""
    texts = [result.clip, result.clip_sha256]
    texts += [text for score in result.scores for text in (score.row, score.key)]
    texts += [text for skip in result.skips for text in (skip.row, skip.key, skip.why)]
    texts += [embedding.row for embedding in result.embeddings]
    numbers = [score.value for score in result.scores]
    numbers += [value for embedding in result.embeddings for value in embedding.values]
    numbers += [part for score in result.scores for part in score.parts if part is not None]
    whole = type(result.item) is int and result.item >= 0
    finite = all(type(number) in (int, float) and abs(number) < math.inf for number in numbers)
    return whole and finite and all(isinstance(text, str) for text in texts)
