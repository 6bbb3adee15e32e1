"""The table of a folder, and what a broken clip does to it."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import exact_clip, write_shards
from oracles_clips import make_clip

from diff4splat.data.clip import Clip
from diff4splat.data.consistency.check import MEASURED
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.checking import check_folder, tolerances_for
from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.progress.phases import Phases


class Counting(Phases):
    """Remembers how many clips a check announced."""

    def __init__(self) -> None:
        super().__init__()
        self.steps: list[int] = []

    def bar(self, name: str, steps: int):
        self.steps.append(steps)
        return super().bar(name, steps)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=1, moving=3)


def rows(table: str) -> dict[str, list[str]]:
    lines = [line.strip("| ").split(" | ") for line in table.splitlines() if line[:1] == "|"]
    return {cells[0]: cells[1:] for cells in lines[2:]}


def test_every_kind_of_truth_has_a_row(folder: Path) -> None:
    found = rows(check_folder(folder, None, Phases()))
    assert {"rotation", "reprojection", "flow_px", "projection_px", "across_views"} <= set(found)
    worst, limit, median, count = found["projection_px"]
    assert limit == "at most 0.001"
    assert 0 <= float(median) <= float(worst) < 1e-3
    assert int(count.replace(",", "")) > 100
    assert found["visible_depth"][0].endswith(" agree")


def test_every_figure_stands_beside_its_limit_and_a_verdict_ends_the_table(folder: Path) -> None:
    table = check_folder(folder, None, Phases())
    assert table.splitlines()[-1] == "consistent: all 4 clips hold every limit"
    for name, cells in rows(table).items():
        if cells[0] == "–":
            continue
        value, limit = float(cells[0].split()[0]), float(cells[1].split()[-1])
        assert value >= limit if "least" in cells[1] else value <= limit, name


@pytest.mark.parametrize(("most", "looked_at"), [(None, 4), (1, 1), (2, 2), (99, 4)])
def test_so_many_clips_are_looked_at(folder: Path, most: int | None, looked_at: int) -> None:
    phases = Counting()
    check_folder(folder, most, phases)
    assert phases.steps == [looked_at]


@pytest.mark.parametrize("most", [0, -1])
def test_looking_at_none_is_refused(folder: Path, most: int) -> None:
    with pytest.raises(ConfigError, match=f"--most: expected at least 1, got {most}; leave it out"):
        check_folder(folder, most, Phases())


def write(folder: Path, *clips: Clip) -> Path:
    with ShardWriter(folder, ShardOptions(generator="test 1")) as writer:
        for clip in clips:
            writer.write(clip)
    return folder


def test_what_is_not_there_is_not_compared(tmp_path: Path) -> None:
    clip = exact_clip(0, True)
    views = tuple(
        replace(view, flow=None, track_uv=None, track_visible=None) for view in clip.views
    )
    found = rows(
        check_folder(write(tmp_path, replace(clip, views=views, tracks=None)), 1, Phases())
    )
    assert found["projection_px"] == ["–", "–", "–", "0"]
    assert found["flow_px"] == ["–", "–", "–", "0"]


def test_a_clip_that_disagrees_is_named_with_its_likely_cause(tmp_path: Path) -> None:
    good, bad = exact_clip(0, True), exact_clip(1, True)
    uv = bad.views[0].track_uv + 0.5
    spoiled = replace(bad, views=(replace(bad.views[0], track_uv=uv), *bad.views[1:]))
    write(tmp_path, good, spoiled)
    with pytest.raises(InputError, match=r"clip 'clip-1': .* expected at most 0.001") as caught:
        check_folder(tmp_path, None, Phases())
    assert "half a pixel" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert check_folder(tmp_path, 1, Phases())  # the first one alone is fine


def test_measured_truth_may_be_less_exact(tmp_path: Path) -> None:
    clip = exact_clip(0, True)
    moved = tuple(replace(view, track_uv=view.track_uv + 0.3) for view in clip.views)
    rough = replace(clip, views=moved, note=replace(clip.note, metric="aligned"))
    assert "projection_px" in check_folder(write(tmp_path / "rough", rough), None, Phases())
    with pytest.raises(InputError, match="clip-0"):
        exact = replace(rough, note=clip.note)
        check_folder(write(tmp_path / "exact", exact), None, Phases())


def test_damaged_bytes_are_named(tmp_path: Path) -> None:
    write_shards(tmp_path, still=1, moving=0)
    content = bytearray((tmp_path / "shard-00000.tar").read_bytes())
    content[len(content) // 2] ^= 0x10
    (tmp_path / "shard-00000.tar").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"shard-00000\.tar: clip 'clip-0'"):
        check_folder(tmp_path, None, Phases())


def test_folders_without_clips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        check_folder(tmp_path, None, Phases())
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")):
        pass
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        check_folder(tmp_path, None, Phases())


def test_an_infinite_figure_is_not_taken_for_agreement(tmp_path: Path) -> None:
    clip = exact_clip(0, True)
    tracks = replace(clip.tracks, positions=clip.tracks.positions + torch.tensor([0.0, 0.0, 100.0]))
    with pytest.raises(InputError, match="clip-0"):
        check_folder(write(tmp_path, replace(clip, tracks=tracks)), None, Phases())


@pytest.mark.parametrize(("side", "share"), [(256, 0.95), (128, 0.95), (64, 0.9), (32, 0.8)])
def test_small_images_may_have_more_points_at_edges(side: int, share: float) -> None:
    clip = make_clip(frames=1, size_px=(side, side), views=1, tracks=0)
    assert tolerances_for(clip).visible_share == pytest.approx(share)
    measured = replace(clip, note=replace(clip.note, metric="aligned"))
    assert tolerances_for(measured) == MEASURED
