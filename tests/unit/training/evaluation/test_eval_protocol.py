"""Protocols: the shipped one never changes, and files are read strictly."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from oracles_evaluation import tiny_protocol

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.training.evaluation.protocol import Judged
from diff4splat.training.evaluation.protocol_json import (
    load_protocol,
    parse_protocol,
    protocol_json,
    protocol_names,
)

HELD_OUT_V1 = "4d9505753cb2eb8a"
"""Results were published under it: a better protocol gets a new name."""


SOURCE = json.loads(protocol_json(tiny_protocol()))["source"]


def changed(**changes: object) -> str:
    return json.dumps(json.loads(protocol_json(tiny_protocol())) | changes)


def test_the_shipped_protocol_never_changes() -> None:
    assert protocol_names() == ("held_out_v1",)
    assert load_protocol("held_out_v1").protocol.digest == HELD_OUT_V1


def test_a_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    file.write_text(protocol_json(tiny_protocol()))
    loaded = load_protocol(str(file))
    assert loaded.protocol == tiny_protocol()
    assert loaded.folder == tmp_path


def test_every_number_changes_the_digest() -> None:
    protocol = tiny_protocol()
    changes = [
        replace(protocol, seed=1),
        replace(protocol, still_px=0.4),
        replace(protocol, source=replace(protocol.source, first=1)),
        replace(protocol, bootstrap=replace(protocol.bootstrap, coverage=0.9)),
    ]
    assert len({one.digest for one in (protocol, *changes)}) == len(changes) + 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "expected JSON"),
        ("[]", "expected the format"),
        (changed(format="other"), "expected the format 'diff4splat-evaluation'"),
        (changed(version=2), "expected version 1, got 2; a newer diff4splat"),
        (changed(extra=1), "got 'extra'; correct it"),
        (changed(frames="five"), "frames: expected int, got 'five'"),
        (changed(frames=True), "frames: expected int, got True"),
        (changed(size_px=[1, 2, 3]), "size_px: expected 2 values, got [1, 2, 3]"),
        (changed(source=3), "source: expected an object, got 3"),
        (
            changed(source=SOURCE | {"kind": "films"}),
            "source.kind: expected one of worlds, shards, got 'films'",
        ),
        (changed(track_frames=4), "track_frames: expected a list, got 4"),
    ],
)
def test_what_is_no_protocol_is_refused(text: str, says: str) -> None:
    with pytest.raises(FileFormatError, match=r"here.*") as error:
        parse_protocol(text, "here")
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_key_is_named() -> None:
    data = json.loads(protocol_json(tiny_protocol()))
    del data["still_px"]
    with pytest.raises(FileFormatError, match="expected the key 'still_px', got none"):
        parse_protocol(json.dumps(data), "here")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"frames": 0}, "of at least 1"),
        ({"generation": Judged(pairs=((2, 0),), source_frames=(0,))}, "pairs within 2 views"),
        ({"generation": Judged(pairs=((0, 5),), source_frames=(0,))}, "frames 0 to 4"),
        ({"generation": Judged(pairs=(), source_frames=(0,))}, "at least one per task"),
        ({"reconstruction": Judged(pairs=((0, 1),), source_frames=(9,))}, "frames 0 to 4"),
        ({"track_frames": (7,)}, "track_frames below 5"),
        ({"still_px": -1.0}, "still_px of at least 0"),
        ({"text_cases": 99}, "text_cases from 0 to source.count"),
    ],
)
def test_values_out_of_range_are_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigError) as error:
        replace(tiny_protocol(), **change)
    assert says in str(error.value)


def test_unknown_names_say_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"expected held_out_v1 or a \.json file, got 'held'"):
        load_protocol("held")
    with pytest.raises(FileFormatError, match="no such file"):
        load_protocol(str(tmp_path / "none.json"))
