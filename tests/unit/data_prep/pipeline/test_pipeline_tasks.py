"""Tasks of a pipeline: every step, bad clips, empty tasks, and stops."""

from dataclasses import replace
from pathlib import Path

import pytest
from several_sequences import write_sequences, write_settings

from diff4splat.cli.main import run
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.curation import score_folders
from diff4splat.data_prep.pipeline.settings import PipelineSettings, read_settings
from diff4splat.data_prep.pipeline.task import part_folder, run_task
from diff4splat.errors import ConfigError
from diff4splat.progress.phases import Phases

CAPTIONED = '[captions]\ncaptions = "captions.json"'


def settings(folder: Path, tasks: int, more: str = CAPTIONED) -> PipelineSettings:
    (folder / "captions.json").write_text("{}")
    return read_settings(write_settings(folder, tasks, more))


def test_all_steps_of_all_tasks_and_then_one_selection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_sequences(tmp_path / "copy", 4, damaged=(2,))
    wanted = settings(tmp_path, 2)
    results = [run_task(wanted, task, Phases()) for task in range(2)]
    assert sum(result.clips for result in results) == 3
    assert sum(result.failed for result in results) == 1, "one bad clip is a row"
    folders = [str(result.folder) for result in results]
    # Scores of the tasks count: nothing is measured again.
    monkeypatch.setattr(score_folders, "score_stored_clip", None)
    assert run(["prepare", "curate", *folders, "--out", str(tmp_path / "report")]) == 0
    assert len((tmp_path / "report" / "decisions.csv").read_text().splitlines()) == 4


def test_a_task_without_any_sequence_is_an_empty_folder_of_clips(tmp_path: Path) -> None:
    write_sequences(tmp_path / "copy", 1)
    wanted = settings(tmp_path, 3)
    results = [run_task(wanted, task, Phases()) for task in range(3)]
    assert sorted(result.clips for result in results) == [0, 0, 1]
    for task in range(3):
        for step in ("imported", "captioned"):
            ClipFolder(part_folder(wanted, step, task)).check()
    empty = next(task for task in range(3) if not results[task].clips)
    command = ["prepare", "import", str(tmp_path / "copy"), "--dataset", "realestate10k"]
    command += ["--out", str(tmp_path / "alone"), "--task", str(empty), "--tasks", "3"]
    assert run(command) == 0 == run(command), "no clip is in the way of the second run"
    assert not len(ClipFolder(tmp_path / "alone"))


def test_a_task_is_a_command_of_its_own(tmp_path: Path) -> None:
    write_sequences(tmp_path / "copy", 2)
    file = str(write_settings(tmp_path, 2))
    for task in "01":
        assert run(["prepare", "pipeline", file, "--task", task]) == 0
    assert run(["prepare", "pipeline", file, "--task", "2"]) == 2
    parts = sorted((tmp_path / "work" / "imported").iterdir())
    assert [part.name for part in parts] == ["part-00000", "part-00001"]
    assert sum(len(ClipFolder(part)) for part in parts) == 2


def test_only_tasks_that_exist(tmp_path: Path) -> None:
    wanted = replace(settings(tmp_path, 2), captions=None)
    with pytest.raises(ConfigError, match="task: expected 0 to 1, got 2"):
        run_task(wanted, 2, Phases())
