"""Protocols: the shipped one never changes, and files are read strictly."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from oracles_evaluation import tiny_protocol

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.evaluation.protocols.protocol import Targets
from diff4splat.evaluation.protocols.protocol_json import (
    load_protocol,
    parse_protocol,
    protocol_json,
    protocol_names,
)

SHIPPED = {
    "held_out_v1": "4d9505753cb2eb8a",
    "held_out_v2": "3ded81828293712c",
    "path_v1": "942182ba0d820732",
    "text_v1": "8156f424f0c6d04f",
}
"""Results are published under them: a better protocol gets a new name."""
SOURCE = json.loads(protocol_json(tiny_protocol()))["source"]


def changed(**changes: object) -> str:
    return json.dumps(json.loads(protocol_json(tiny_protocol())) | changes)


def test_shipped_protocols_never_change() -> None:
    assert protocol_names() == tuple(SHIPPED)
    assert {name: load_protocol(name).protocol.digest for name in SHIPPED} == SHIPPED


def test_the_first_one_gives_every_frame_and_does_not_say_so() -> None:
    first = load_protocol("held_out_v1").protocol
    assert first.input_frames("reconstruction") == tuple(range(17))
    assert "input_stride" not in protocol_json(first)
    said = json.loads(protocol_json(first)) | {"input_stride": 1}
    assert parse_protocol(json.dumps(said), "here").digest == SHIPPED["held_out_v1"]


def test_the_second_one_judges_views_and_times_that_are_not_given() -> None:
    first, second = (load_protocol(name).protocol for name in ("held_out_v1", "held_out_v2"))
    given = second.input_frames("reconstruction")
    assert given == (0, 2, 4, 6, 8, 10, 12, 14, 16)
    judged = second.reconstruction
    assert all(view in (1, 2) and frame not in given for view, frame in judged.pairs)
    assert len(set(judged.pairs)) == 12
    assert set(judged.source_frames) <= set(given)
    between = [frame for frame in second.track_frames if frame not in given]
    assert len(between) > len(second.track_frames) / 2
    # The clips, and what is asked of one image, are the same.
    assert (second.source, second.generation) == (first.source, first.generation)
    assert second.input_frames("generation") == second.input_frames("text") == (0,)


def test_a_stride_changes_the_digest_and_comes_back() -> None:
    protocol = replace(tiny_protocol(), input_stride=3)
    assert protocol.input_frames("reconstruction") == (0, 3)
    assert parse_protocol(protocol_json(protocol), "here") == protocol
    assert protocol.digest != tiny_protocol().digest


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
        ({"generation": Targets(pairs=((2, 0),), source_frames=(0,))}, "pairs within 2 views"),
        ({"generation": Targets(pairs=((0, 5),), source_frames=(0,))}, "frames 0 to 4"),
        ({"generation": Targets(pairs=(), source_frames=(0,))}, "at least one per task"),
        ({"reconstruction": Targets(pairs=((0, 1),), source_frames=(9,))}, "frames 0 to 4"),
        ({"track_frames": (7,)}, "track_frames below 5"),
        ({"still_px": -1.0}, "still_px of at least 0"),
        ({"input_stride": 0}, "input_stride from 1 to 5"),
        ({"input_stride": 6}, "input_stride from 1 to 5"),
        ({"text_cases": 99}, "text_cases from 0 to source.count"),
    ],
)
def test_values_out_of_range_are_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigError) as error:
        replace(tiny_protocol(), **change)
    assert says in str(error.value)


def test_another_size_is_another_protocol_on_the_same_clips() -> None:
    shipped = load_protocol("held_out_v2").protocol
    found = shipped.at_size((64, 64))
    assert (found.name, found.size_px) == ("held_out_v2 at 64 px", (64, 64))
    assert found.loop.size_px == (64, 64) and found.pose == shipped.pose
    assert (found.source, found.reconstruction) == (shipped.source, shipped.reconstruction)
    assert found.digest not in SHIPPED.values()
    with pytest.raises(ConfigError, match="of at least 1"):
        shipped.at_size((0, 0))


def test_unknown_names_say_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"path_v1, text_v1 or a \.json file, got 'held'"):
        load_protocol("held")
    with pytest.raises(FileFormatError, match="no such file"):
        load_protocol(str(tmp_path / "none.json"))
