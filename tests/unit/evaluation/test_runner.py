"""Whole runs: resuming, failing items, subsets, and the files that are left."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from listed_clips import ListedClips
from oracles_evaluation import Fixed, filmed, tiny_protocol, wall_and_patch

from diff4splat.data.clip import Clip
from diff4splat.errors import FileFormatError, InputError, OutputError
from diff4splat.evaluation.columns import columns_of
from diff4splat.evaluation.evaluate import OUTPUT_FILES, Evaluation, RunLimits, evaluate
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.report.result_store import run_key
from diff4splat.metrics.features.load import load_features
from diff4splat.progress.phases import Phases

SCENE = wall_and_patch((0.3, 0.0, 0.0))


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    return [filmed(wall_and_patch((0.1 * (i + 1), 0, 0)), f"clip-{i}") for i in range(3)]


@pytest.fixture
def setup() -> Setup:
    return Setup(protocol=tiny_protocol(), task="generation", system=Fixed(SCENE))


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Pose recovery and the page have tests of their own, and take most of the time."""
    monkeypatch.setattr("diff4splat.evaluation.measure_item.pose_entries", lambda *_: [])
    page = "diff4splat.evaluation.evaluate.draw_sheet"
    monkeypatch.setattr(page, lambda *_: torch.zeros(4, 4, 3))
    yield


def run(clips: list[Clip], setup: Setup, out: Path, **extent: object) -> Evaluation:
    return evaluate(ListedClips(clips), setup, out, RunLimits(**extent), Phases())


def test_a_run_leaves_its_files_and_nothing_else(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    found = run(clips, setup, tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {*OUTPUT_FILES, "items.jsonl"}
    stored = json.loads((tmp_path / "results.json").read_text())
    assert stored["format"] == "diff4splat-evaluation-results 1"
    assert stored["protocol"]["digest"] == setup.protocol.digest
    assert stored["protocol"]["track_frames"] == [0, 2, 4]
    assert [item["clip"] for item in stored["items"]] == ["clip-0", "clip-1", "clip-2"]
    assert not stored["subset"]
    assert (tmp_path / "results.md").read_text() == found.markdown
    # The third clip is the scene itself.
    assert found.summary.ranking[0].clip == "clip-2"
    assert found.summary.difference("psnr").baseline == "best plane (oracle)"


def test_equal_runs_write_equal_bytes(clips: list[Clip], setup: Setup, tmp_path: Path) -> None:
    for name in ("a", "b"):
        run(clips, setup, tmp_path / name, limit=1)
    for name in (*OUTPUT_FILES, "items.jsonl"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_is_measured_is_not_measured_again(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    first = run(clips, setup, tmp_path, limit=2)
    assert first.outcome.is_subset
    assert "**subset**: the first 2 of 3; not comparable" in first.markdown
    measured = {item.item: item for item in first.outcome.items}
    setup.system.calls = 0
    second = run(clips, setup, tmp_path)
    # One new item, and three for the page.
    assert setup.system.calls == 1 + 3
    assert second.outcome.resumed == 2
    assert {item.item: item for item in second.outcome.items[:2]} == measured
    setup.system.calls = 0
    third = run(clips, setup, tmp_path, fresh=True)
    assert setup.system.calls == 3 + 3
    assert third.markdown == second.markdown


def test_another_protocol_or_model_measures_anew(setup: Setup) -> None:
    class Other(Fixed):
        identity = replace(setup.system.identity, weights_sha256="abc")

    others = [
        replace(setup, protocol=replace(setup.protocol, seed=1)),
        replace(setup, system=Other(SCENE)),
        replace(setup, task="reconstruction"),
        replace(setup, features=load_features()),
    ]
    assert len({run_key(one) for one in (setup, *others)}) == 5
    assert run_key(setup) == run_key(replace(setup))


def test_items_from_before_a_column_was_added_are_measured_anew(
    setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = run_key(setup)
    fewer = columns_of(setup.task)[:-1]
    monkeypatch.setattr("diff4splat.evaluation.report.result_store.columns_of", lambda task: fewer)
    assert run_key(setup) != now


def test_an_interrupt_costs_one_item(
    clips: list[Clip], setup: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted(ListedClips):
        def clip(self, index: int) -> Clip:
            if index == 2:
                raise KeyboardInterrupt
            return super().clip(index)

    with pytest.raises(KeyboardInterrupt):
        evaluate(Interrupted(clips), setup, tmp_path, RunLimits(), Phases())
    assert [file.name for file in tmp_path.iterdir()] == ["items.jsonl"]
    assert run(clips, setup, tmp_path).outcome.resumed == 2


def test_a_failing_item_is_counted_and_named_and_the_rest_goes_on(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    short = replace(clips[1], views=clips[1].views[:1])
    found = run([clips[0], short, clips[2]], setup, tmp_path)
    assert [failure.clip for failure in found.outcome.failures] == ["clip-1"]
    assert "- failed: item 1 (clip-1): clip clip-1: expected 5 frames" in found.markdown
    assert "2 of 3 items" in found.markdown
    # Mended, it is measured; the others are taken up.
    assert run(clips, setup, tmp_path).outcome.resumed == 2


def test_bugs_of_a_system_are_failures_with_their_kind(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    class Broken(Fixed):
        def predict(self, case: object, seed: int) -> None:
            raise RuntimeError("out of\nmemory")

    with pytest.raises(InputError, match=r"all 3 items failed, the first \(clip-0\) with: Runtime"):
        run(clips, replace(setup, system=Broken(SCENE)), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_too_few_clips_are_refused(clips: list[Clip], setup: Setup, tmp_path: Path) -> None:
    for there in ([], clips[:2]):
        with pytest.raises(InputError, match=f"expected at least 3 for .*, got {len(there)}"):
            run(there, setup, tmp_path)


@pytest.mark.parametrize("limit", [0, 4])
def test_subsets_lie_within_the_protocol(
    clips: list[Clip], setup: Setup, tmp_path: Path, limit: int
) -> None:
    with pytest.raises(InputError, match=rf"--items: expected 1 to 3 .*, got {limit}"):
        run(clips, setup, tmp_path, limit=limit)


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_measured(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    file = tmp_path / "taken"
    file.write_text("here")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        run(clips, setup, file)
    assert setup.system.calls == 0


@pytest.mark.parametrize("text", ["{", "[1]\n", '{"format": "x"}\n', ""])
def test_damaged_items_say_what_to_do(
    clips: list[Clip], setup: Setup, tmp_path: Path, text: str
) -> None:
    (tmp_path / "items.jsonl").write_text(text)
    with pytest.raises(FileFormatError, match="--fresh"):
        run(clips, setup, tmp_path)


def test_damaged_rows_say_what_to_do(clips: list[Clip], setup: Setup, tmp_path: Path) -> None:
    run(clips, setup, tmp_path, limit=1)
    file = tmp_path / "items.jsonl"
    file.write_text(file.read_text().replace('"scores"', '"score"'))
    with pytest.raises(FileFormatError, match="expected results of an evaluation"):
        run(clips, setup, tmp_path)


def test_text_runs_draw_their_captions(clips: list[Clip], tmp_path: Path) -> None:
    setup = Setup(protocol=tiny_protocol(), task="text", system=Fixed(SCENE))
    found = run(clips, setup, tmp_path)
    assert found.outcome.requested == 2
    assert "| **fixed** | 0.5 [0.5, 0.5] | 0 [0, 0] |" in found.markdown


def test_the_page_survives_clips_without_depth(
    clips: list[Clip], setup: Setup, tmp_path: Path
) -> None:
    blind = [
        replace(c, views=tuple(replace(v, depth=torch.zeros_like(v.depth)) for v in c.views))
        for c in clips
    ]
    found = run(blind, setup, tmp_path)
    assert (
        "not measured on 3 items: depth_absrel of system: the clip has no depth" in found.markdown
    )
    assert (tmp_path / "items.png").is_file()
