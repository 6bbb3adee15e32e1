"""Protocols name their clips: shards in a folder, or worlds of one split and seed."""

from dataclasses import replace
from pathlib import Path

import pytest
from oracles_clips import make_clip
from oracles_evaluation import FRAMES, SIZE, tiny_protocol

from diff4splat.data.clip import Clip
from diff4splat.data.codecs.encode import Coding
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError
from diff4splat.evaluation.protocols import datasets as opening
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol
from diff4splat.training.recipe.data import DataSettings, SourceSettings


def test_shards_lie_beside_the_protocol_file(tmp_path: Path) -> None:
    options = ShardOptions(generator="test 1", coding=Coding(depth="float"))
    with ShardWriter(tmp_path / "clips", options) as writer:
        for seed in range(2):
            writer.write(make_clip(FRAMES, SIZE, seed=seed))
    protocol = tiny_protocol(2)
    source = replace(protocol.source, kind="shards", folder="clips")
    opened = open_clips(LoadedProtocol(protocol=replace(protocol, source=source), folder=tmp_path))
    assert len(opened) == 2
    assert opened.clip(1).note.identifier == "clip-1"


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    protocol = tiny_protocol(2)
    source = replace(protocol.source, kind="shards", folder="none")
    with pytest.raises(FileFormatError):
        open_clips(LoadedProtocol(protocol=replace(protocol, source=source), folder=tmp_path))


def test_worlds_are_asked_for_as_the_protocol_says(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    class Worlds:
        def clip(self, index: int) -> Clip:
            asked.append(index)
            return make_clip(1, (8, 8), views=1, seed=index)

    def source_of(settings: SourceSettings, data: DataSettings, seed: int) -> Worlds:
        asked.extend([settings, data, seed])
        return Worlds()

    monkeypatch.setattr(opening, "open_source", source_of)
    protocol = tiny_protocol(2)
    source = replace(protocol.source, first=5, seed=9)
    clips = open_clips(LoadedProtocol(protocol=replace(protocol, source=source), folder=Path()))
    assert len(clips) == 7
    assert clips.clip(6).note.identifier == "clip-6"
    settings, data, seed, index = asked
    assert (settings.split, settings.still_share, seed, index) == ("held_out", 0.25, 9, 6)
    assert (data.size_px, data.frames, data.views) == (SIZE, FRAMES, 2)
