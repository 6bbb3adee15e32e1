"""JSON values become dataclasses only when every one of them fits."""

from dataclasses import dataclass
from typing import Literal

import pytest

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.training.config_codec import TypedReader


class Own:
    def __init__(self, text: str) -> None:
        self.text = text


@dataclass(frozen=True)
class Inner:
    share: float
    kind: Literal["a", "b"] = "a"


@dataclass(frozen=True)
class Outer:
    inner: Inner
    pairs: tuple[tuple[int, int], ...]
    own: Own
    ready: bool = False


GOOD = {"inner": {"share": 1}, "pairs": [[1, 2], [3, 4]], "own": "x"}


def read(value: object) -> Outer:
    return TypedReader(error_type=ConfigError, readers={Own: Own}).read(Outer, value, "file")


def test_records_tuples_literals_and_numbers() -> None:
    found = read(GOOD | {"ready": True})
    assert found.inner == Inner(1.0) and type(found.inner.share) is float
    assert found.pairs == ((1, 2), (3, 4)) and found.own.text == "x" and found.ready


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"more": 1}, "file: expected the keys inner, pairs, own, ready, got 'more'"),
        ({"inner": {}}, "file.inner: expected the key 'share', got none"),
        ({"inner": 3}, "file.inner: expected an object, got 3"),
        ({"inner": {"share": True}}, "file.inner.share: expected float, got True"),
        ({"inner": {"share": 1, "kind": "c"}}, "file.inner.kind: expected one of a, b, got 'c'"),
        ({"pairs": 4}, "file.pairs: expected a list, got 4"),
        ({"pairs": [[1]]}, "file.pairs[0]: expected 2 values, got [1]"),
        ({"pairs": [[1, 2.0]]}, "file.pairs[0][1]: expected int, got 2.0"),
        ({"ready": 1}, "file.ready: expected bool, got 1"),
        ({"ready": "x" * 999}, f"got '{'x' * 59}; correct it"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(change: dict, says: str) -> None:
    with pytest.raises(ConfigError) as error:
        read(GOOD | change)
    assert says in str(error.value)


def test_the_caller_chooses_the_error() -> None:
    with pytest.raises(FileFormatError, match="file: expected an object, got none"):
        TypedReader(error_type=FileFormatError).read(Inner, None, "file")
