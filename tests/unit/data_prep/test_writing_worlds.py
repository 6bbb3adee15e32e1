"""Worlds into shards: whatever the number of processes, after any stop, the same clips."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from oracles_clip_equality import first_difference

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep import writing
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world, world_identifier
from diff4splat.data_prep.writing import WorldJob, write_worlds
from diff4splat.errors import ConfigError, FileFormatError, OutputError
from diff4splat.progress.phases import Phases

RECIPE = WorldRecipe(seed=3, frames=5, size_px=(32, 32), views=2, still_share=0.3)
DRAW = DrawSettings(tracks=16)


def job(folder: Path, clips: int = 3, **changes: object) -> WorldJob:
    whole = WorldJob(folder=folder, clips=clips, recipe=RECIPE, draw=DRAW)
    return replace(whole, **changes)


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    assert write_worlds(job(folder), Phases()) == 3
    return folder


def test_clips_are_those_of_their_worlds_in_order(whole: Path) -> None:
    clips = ClipFolder(whole)
    assert list(clips.identifiers) == [world_identifier(RECIPE, index) for index in range(3)]
    direct = draw_clip(make_world(RECIPE, 1), DRAW)
    stored = clips.clip(1)
    assert torch.equal(stored.views[1].rgb, direct.views[1].rgb)
    assert stored.note == direct.note
    assert {entry.size_px for entry in clips.entries} == {(32, 32)}


@pytest.mark.slow
def test_no_result_depends_on_the_number_of_processes(whole: Path, tmp_path: Path) -> None:
    assert write_worlds(job(tmp_path, workers=2), Phases()) == 3
    assert contents(tmp_path) == contents(whole)


def test_going_on_adds_a_shard_and_draws_nothing_twice(whole: Path, tmp_path: Path) -> None:
    write_worlds(job(tmp_path, clips=2), Phases())
    first = contents(tmp_path)
    assert write_worlds(job(tmp_path), Phases(), append=True) == 1
    second = contents(tmp_path)
    assert {name: second[name] for name in first if name != "manifest.json"} == {
        name: content for name, content in first.items() if name != "manifest.json"
    }
    assert "shard-00001.tar" in second
    parts, together = ClipFolder(tmp_path), ClipFolder(whole)
    assert parts.identifiers == together.identifiers
    for position in range(3):
        assert first_difference(parts.clip(position), together.clip(position)) is None
    assert write_worlds(job(tmp_path), Phases(), append=True) == 0
    assert contents(tmp_path) == second


def test_a_series_goes_on_in_another_folder(whole: Path, tmp_path: Path) -> None:
    write_worlds(job(tmp_path, clips=1, first=2), Phases())
    assert first_difference(ClipFolder(tmp_path).clip(0), ClipFolder(whole).clip(2)) is None


def interrupted_at(clip: int, stop: Callable[[], None]) -> Callable[..., object]:
    """``_draw`` that is stopped before it draws one clip."""
    draw = writing._draw

    def drawing(job: WorldJob, index: int) -> object:
        if index == clip:
            stop()
        return draw(job, index)

    return drawing


def ctrl_c() -> None:
    os.kill(os.getpid(), signal.SIGINT)
    signal.pause()


def full_disk() -> None:
    raise OSError(28, "No space left on device")


def test_an_interrupt_keeps_what_was_drawn(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "_draw", interrupted_at(2, ctrl_c))
    with pytest.raises(KeyboardInterrupt):
        write_worlds(job(tmp_path), Phases())
    assert ClipFolder(tmp_path).identifiers == ClipFolder(whole).identifiers[:2]
    assert not list(tmp_path.glob(".partial*"))
    monkeypatch.undo()
    assert write_worlds(job(tmp_path), Phases(), append=True) == 1
    assert ClipFolder(tmp_path).identifiers == ClipFolder(whole).identifiers


def test_a_failure_leaves_whole_shards_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_worlds(job(tmp_path, clips=1), Phases())
    before = contents(tmp_path)
    monkeypatch.setattr(writing, "_draw", interrupted_at(2, full_disk))
    with pytest.raises(OSError, match="No space left"):
        write_worlds(job(tmp_path), Phases(), append=True)
    assert contents(tmp_path) == before


def test_a_folder_with_clips_is_only_added_to_when_asked(whole: Path) -> None:
    before = contents(whole)
    with pytest.raises(OutputError, match=r"expected a folder without clips, .* append to it"):
        write_worlds(job(whole, clips=9), Phases())
    assert contents(whole) == before


@pytest.mark.parametrize(
    "change", [{"size_px": (40, 40)}, {"frames": 9}, {"views": 1}], ids=["size", "frames", "views"]
)
def test_clips_drawn_otherwise_are_not_taken_for_done(
    whole: Path, change: dict[str, object]
) -> None:
    before = contents(whole)
    other = job(whole, recipe=replace(RECIPE, **change))
    with pytest.raises(ConfigError, match=r"expected clip 'worlds-v1-training-3-00000000' with"):
        write_worlds(other, Phases(), append=True)
    assert contents(whole) == before


def test_clips_of_another_size_may_be_added_under_other_names(tmp_path: Path) -> None:
    write_worlds(job(tmp_path, clips=1), Phases())
    larger = job(tmp_path, clips=1, first=7, recipe=replace(RECIPE, size_px=(40, 40)))
    assert write_worlds(larger, Phases(), append=True) == 1
    assert [entry.size_px for entry in ClipFolder(tmp_path).entries] == [(32, 32), (40, 40)]


def test_a_damaged_manifest_is_not_added_to(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        write_worlds(job(tmp_path), Phases(), append=True)
    assert contents(tmp_path) == {"manifest.json": b"{"}


@pytest.mark.parametrize("change", [{"clips": 0}, {"workers": 0}, {"first": -1}])
def test_counts_out_of_range_are_refused(tmp_path: Path, change: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="expected --clips and --workers of at least 1"):
        job(tmp_path, **change)
