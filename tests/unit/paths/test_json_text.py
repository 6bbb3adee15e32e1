"""JSON of strangers: what any program writes is read, what breaks Python's decoder is refused."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_text import MAX_DEPTH, decode_json, decode_object

_PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
_TREES = st.recursive(
    _PLAIN, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=30
)


@given(_TREES)
def test_what_json_wrote_comes_back(value: object) -> None:
    text = json.dumps(value)
    assert decode_json(text) == value
    assert decode_json(text.encode("utf-8-sig")) == value


@pytest.mark.parametrize("digits", [310, 5000, 100_000])
def test_whole_numbers_of_hundreds_of_digits_are_infinite(digits: int) -> None:
    assert decode_json("[" + "9" * digits + "]") == [math.inf]
    assert decode_json("-" + "9" * digits) == -math.inf
    assert decode_json("9" * 300) == 10**300 - 1


@pytest.mark.parametrize("depth", [MAX_DEPTH + 1, 900, 100_000])
def test_deep_nesting_is_refused(depth: int) -> None:
    for opening, closing in (("[", "]"), ('{"a":', "}")):
        with pytest.raises(FileFormatError, match="64 levels"):
            decode_json(opening * depth + "1" + closing * depth)


def test_brackets_in_texts_are_no_nesting() -> None:
    value = ["[{" * 500 + '"\\' * 3] * 3
    assert decode_json(json.dumps(value)) == value
    assert decode_json("[" * MAX_DEPTH + "]" * MAX_DEPTH)


@pytest.mark.parametrize("content", [b"\xff\xfe{}", "", "{", "[1,]", "nothing", b"\0", '"\n"'])
def test_other_texts_are_refused(content: str | bytes) -> None:
    with pytest.raises(FileFormatError, match="expected JSON"):
        decode_json(content)


@pytest.mark.parametrize("text", ["[]", "3", "null", '"a"'])
def test_only_objects_are_objects(text: str) -> None:
    with pytest.raises(FileFormatError, match="expected a JSON object"):
        decode_object(text)
    assert decode_object('{"a": [1]}') == {"a": [1]}
