"""Damage to JSON that stays JSON: another value, a missing key, a list that is too long."""

import json
from collections.abc import Iterator
from random import Random

_HOLE = "\N{SNOWMAN}"
"""Marks where a raw value goes that ``json`` itself would not write."""
VALUES = (
    *("0", "-1", "1", "2", "0.5", "1e300", "1e400", "-1e400", "NaN", "Infinity", "-0.0"),
    *(str(2**31), str(2**53), str(2**63), str(2**64), str(-(2**63)), "1" * 400, "9" * 5000),
    *("true", "false", "null", '""', "[]", "{}", "[[]]", '"1"', '"a"', '"\\u00b2"', '"\\u0000"'),
    *(
        '"\\ud800"',
        '"../../a"',
        '"/dev/zero"',
        '"."',
        '"' + "a" * 300 + '"',
        '"' + "b" * 5000 + '"',
    ),
    *("[" * 30 + "]" * 30, "[" * 300 + "]" * 300, "[" * 10**5 + "]" * 10**5),
    *('{"a":' * 300 + "1" + "}" * 300, "[1, 2]", "[1, 2, 3]", "[NaN, 1e39, 1]", '["a"]'),
    *("[" + "0," * 99_999 + "0]", '{"name": 1}'),
)

Node = tuple[object, object]
"""A list or an object, and a position or key in it."""


def change_value(content: bytes, rng: Random) -> bytes:
    """Another value at one place."""
    root = json.loads(content)
    holder, key = rng.choice(list(_nodes(root)) or [(None, None)])
    raw = rng.choice(VALUES)
    if holder is None:
        return raw.encode()
    holder[key] = _HOLE
    return json.dumps(root).replace(json.dumps(_HOLE), raw, 1).encode()


def remove_value(content: bytes, rng: Random) -> bytes:
    """Without one entry."""
    root = json.loads(content)
    for holder, key in _some_node(root, rng):
        del holder[key]
    return json.dumps(root).encode()


def copy_value(content: bytes, rng: Random) -> bytes:
    """The value of one place at another one."""
    root = json.loads(content)
    for (holder, key), (other, name) in zip(
        _some_node(root, rng), _some_node(root, rng), strict=True
    ):
        text = json.dumps(other[name])
        holder[key] = json.loads(text)
    return json.dumps(root).encode()


def repeat_entry(content: bytes, rng: Random) -> bytes:
    """One list with an entry repeated, or an object with an unknown key."""
    root = json.loads(content)
    for holder, key in _some_node(root, rng):
        if isinstance(holder, list):
            holder[key:key] = [holder[key]] * rng.choice((1, 2, 1000))
        else:
            holder[rng.choice(("a", "", "²", "x" * 300))] = holder[key]
    return json.dumps(root).encode()


JSON_EDITS = {
    edit.__name__: edit for edit in (change_value, remove_value, copy_value, repeat_entry)
}


def is_json(content: bytes) -> bool:
    """Whether this is a JSON list or object of a size that is quick to edit."""
    if content[:1] not in (b"{", b"["):
        return False
    try:
        json.loads(content)
    except (ValueError, RecursionError):
        return False
    return True


def _some_node(root: object, rng: Random) -> list[Node]:
    nodes = list(_nodes(root))
    return [rng.choice(nodes)] if nodes else []


def _nodes(root: object) -> Iterator[Node]:
    waiting = [root]
    while waiting:
        holder = waiting.pop()
        keys = range(len(holder)) if isinstance(holder, list) else holder
        for key in list(keys):
            yield holder, key
            if isinstance(holder[key], list | dict):
                waiting.append(holder[key])
