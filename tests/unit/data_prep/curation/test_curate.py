"""Whole runs over folders of shards: tables, report, resumption, selection, bad clips."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from textured_clips import textured_clip

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.curation import score_folders
from diff4splat.data_prep.curation.curate import CurationJob, curate
from diff4splat.data_prep.curation.hooks import Hooks, load_hook
from diff4splat.data_prep.curation.record_store import RecordStore
from diff4splat.data_prep.curation.report.histograms import histogram_svg
from diff4splat.data_prep.curation.report.page import write_report
from diff4splat.data_prep.curation.score_folders import ScoringJob
from diff4splat.data_prep.curation.selection import write_selection
from diff4splat.data_prep.curation.thresholds import Gate, read_thresholds
from diff4splat.errors import ConfigError, OutputError
from diff4splat.progress.phases import Phases

NASTY = "<script>alert('x')</script>"


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """Good, frozen, cut, twice the same, and one whose bytes are damaged."""
    folder = tmp_path_factory.mktemp("curation") / "planes"
    good, moving = textured_clip(7, identifier="good"), textured_clip(7, True, identifier="moving")
    rgb = good.views[0].rgb
    frozen = replace(good.views[0], rgb=rgb[:1].repeat(7, 1, 1, 1))
    every = [
        good,
        moving,
        replace(good, note=replace(good.note, identifier="again", dataset=NASTY)),
        replace(good, note=replace(good.note, identifier="frozen"), views=(frozen,)),
        replace(moving, note=replace(moving.note, identifier="damaged")),
    ]
    with ShardWriter(folder, ShardOptions(generator="test")) as writer:
        for clip in every:
            writer.write(clip)
    shard = folder / "shard-00000.tar"
    content = bytearray(shard.read_bytes())
    at = content.rindex(b"damaged.rgb00.png") + 2048
    content[at : at + 64] = bytes(64)
    shard.write_bytes(content)
    return folder


def job(clips, out, **options) -> CurationJob:
    scoring = ScoringJob(folders=(clips,), out=out, **options)
    return CurationJob(scoring=scoring, thresholds=read_thresholds(None))


def test_one_bad_clip_is_a_row_and_the_others_are_decided(clips, tmp_path) -> None:
    decisions = {d.record.identifier: d for d in curate(job(clips, tmp_path), Phases())}
    assert decisions["moving"].is_selected
    assert decisions["frozen"].reasons[0].text == "frozen"
    assert decisions["damaged"].reasons[0].stage == "reading"
    assert decisions["damaged"].record.error == "FileFormatError"
    twice = [decisions["good"], decisions["again"]]
    assert sorted(d.is_selected for d in twice) == [False, True]
    assert (tmp_path / "selected.txt").read_text().split() == ["again", "moving"]
    assert len((tmp_path / "decisions.csv").read_text().splitlines()) == 6


def test_a_second_run_measures_nothing_and_equal_runs_have_equal_bytes(
    clips, tmp_path, monkeypatch
) -> None:
    curate(job(clips, tmp_path / "a"), Phases())
    first = (tmp_path / "a" / "scores.jsonl").read_bytes()
    lines = first.splitlines(keepends=True)
    (tmp_path / "b").mkdir()
    # As a killed run leaves it: other order, a torn last line.
    (tmp_path / "b" / "scores.jsonl").write_bytes(lines[3] + lines[0] + lines[1][:40])
    curate(job(clips, tmp_path / "b"), Phases())
    assert (tmp_path / "b" / "scores.jsonl").read_bytes() == first
    monkeypatch.setattr(score_folders, "score_stored_clip", None)
    curate(job(clips, tmp_path / "a"), Phases())


def test_a_changed_clip_is_scored_again(clips, tmp_path) -> None:
    curate(job(clips, tmp_path), Phases())
    store = RecordStore(tmp_path)
    old = store.read()[("planes", "good")]
    store.append(replace(old, checksum="other", scores={}))
    curate(job(clips, tmp_path), Phases())
    assert store.read()[("planes", "good")] == old


@pytest.mark.slow
def test_processes_give_the_same_bytes(clips, tmp_path) -> None:
    curate(job(clips, tmp_path / "one"), Phases())
    curate(job(clips, tmp_path / "two", workers=2), Phases())
    names = ("scores.jsonl", "decisions.csv", "selected.txt")
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_selected_clips_are_copied_byte_for_byte(clips, tmp_path) -> None:
    decisions = curate(job(clips, tmp_path), Phases())
    assert write_selection(decisions, (clips,), tmp_path / "shards", Phases()) == 2
    source, target = ClipFolder(clips), ClipFolder(tmp_path / "shards")
    target.check()
    assert target.identifiers == ("again", "moving")
    for position, name in enumerate(target.identifiers):
        place = source.identifiers.index(name)
        assert target.checksum(position) == source.checksum(place)
        assert torch.equal(target.clip(position).views[0].rgb, source.clip(place).views[0].rgb)
    before = (tmp_path / "shards" / "shard-00000.tar").read_bytes()
    write_selection(decisions, (clips,), tmp_path / "shards", Phases())
    assert (tmp_path / "shards" / "shard-00000.tar").read_bytes() == before
    damaged = [replace(d, reasons=()) for d in decisions if d.record.identifier == "damaged"]
    assert write_selection(damaged, (clips,), tmp_path / "bad", Phases()) == 0
    assert "damaged,failed,FileFormatError" in (tmp_path / "bad" / "report.csv").read_text()
    fewer = [d for d in decisions if d.record.identifier != "moving"]
    with pytest.raises(OutputError, match="not selected now, such as 'moving'"):
        write_selection(fewer, (clips,), tmp_path / "shards", Phases())


def test_the_report_is_self_contained_and_escaped(clips, tmp_path) -> None:
    decisions = curate(job(clips, tmp_path), Phases())
    text = write_report(decisions, read_thresholds(None), (clips,), tmp_path, Phases()).read_text()
    assert NASTY not in text
    assert "&lt;script&gt;" in text
    assert not re.search(r"<script|https?://|src=\"(?!data:)", text)
    assert text.count("data:image/jpeg;base64,") == 2
    assert "no image: the clip cannot be read" in text
    assert "flow_p90 0, expected at least 0.002" in text


@pytest.mark.parametrize("values", [[1.0], [0.0] * 50, [1e9, -1e9], [1e-12, 2e-12]])
def test_histograms_of_extreme_values_are_finite(values) -> None:
    gate = Gate(stage="depth", score="x", reason="y", least=0.5)
    svg = histogram_svg(values, [gate])
    assert "nan" not in svg
    assert "inf" not in svg


def test_a_quality_model_is_a_hook_and_its_faults_are_rows(clips, tmp_path, monkeypatch) -> None:
    (tmp_path / "my_quality.py").write_text(
        "def score(frames):\n    assert frames.shape[0] == 3\n    return frames.mean() / 25\n"
        "def text(frames):\n    return 'good'\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    hooks = Hooks(quality="my_quality:score")
    decisions = curate(job(clips, tmp_path / "out", hooks=hooks), Phases())
    assert decisions[-1].record.scores["quality"] == pytest.approx(5.1, abs=0.5)
    hooks = Hooks(quality="my_quality:text")
    decisions = curate(job(clips, tmp_path / "out", hooks=hooks), Phases())
    assert {d.record.stage for d in decisions} == {"quality", "reading"}
    for name in ("my_quality", "my_quality:none", "no_such_module_x:f"):
        with pytest.raises(ConfigError, match="hook"):
            load_hook(name)


def test_folders_of_one_name_are_refused(clips, tmp_path) -> None:
    with pytest.raises(ConfigError, match="different names"):
        ScoringJob(folders=(clips, clips), out=tmp_path)


def test_damaged_lines_of_a_store_are_ignored(tmp_path) -> None:
    store = RecordStore(tmp_path)
    assert store.read() == {}
    damage = b'{"identifier": 3}\n[]\n\xff\xfe\nnot json\n' + b"[" * 100_000 + b"\n"
    store.file.write_bytes(damage)
    assert store.read() == {}
    np.testing.assert_array_equal(store.file.stat().st_size, len(damage))
