"""Settings of a pipeline: read strictly, and the same names as where they are used."""

from pathlib import Path
from typing import get_args

import pytest
from several_sequences import write_settings

from diff4splat.data.codecs import depth
from diff4splat.data_prep.alignment import align_clip, align_folder
from diff4splat.data_prep.pipeline import settings as module
from diff4splat.data_prep.pipeline.settings import read_settings
from diff4splat.data_prep.pipeline.task import check_settings, result_folder
from diff4splat.errors import ConfigError, Diff4SplatError

WHOLE = """
frames = 9
images = "jpeg"
[align]
reference = "megasam"
megasam = "mega"
normaliser = 2
[captions]
captions = "captions.csv"
[score]
quality = "my_model:quality"
[executor]
kind = "slurm"
partition = "cpu"
[executor.sbatch]
account = "me"
"""


def test_every_table_is_read_and_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    found = read_settings(write_settings(tmp_path, 64, WHOLE))
    check_settings(found)
    assert (found.tasks, found.out, found.source.path) == (64, tmp_path / "work", tmp_path / "copy")
    assert (found.source.frames, found.source.images) == (9, "jpeg")
    assert found.align.megasam == tmp_path / "mega" and found.align.normaliser == 2.0
    assert found.score.quality == "my_model:quality"
    assert found.executor.sbatch == {"account": "me"}
    assert result_folder(found) == tmp_path / "work" / "captioned"


def test_names_are_those_of_the_steps() -> None:
    assert get_args(module.ReferenceName) == get_args(align_folder.ReferenceName)
    assert get_args(module.Method) == get_args(align_clip.Method)
    assert get_args(module.DepthCoding) == get_args(depth.DepthCoding)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("frames = 'nine'", "import, frames: expected int, got 'nine'"),
        ("frames = true", "import, frames: expected int, got True"),
        ("frames = 0", "frames: expected at least 1, got 0"),
        ("speed = 1", "keys of import: expected some of"),
        ("images = 'gif'", "import, images: expected one of png, jpeg, mp4, got 'gif'"),
        ("[align]\nreference = 'sun'", "expected one of depth, tracks"),
        ("[align]", "align: expected more keys"),
        ("[align]\nreference = 'megasam'", "expected --megasam FOLDER"),
        ("[captions]", "expected --captions FILE or --captioner"),
        ("[executor]\nkind = 'slurm'", "expected a partition of Slurm"),
        ("[executor]\nworkers = 0", "executor, workers: expected 1 or more"),
        ("[else]", "keys: expected some of"),
        ("[import]", "expected TOML"),
    ],
)
def test_what_is_wrong_is_named(more: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        check_settings(read_settings(write_settings(tmp_path, 2, more)))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["", "version = 2", "version = 1", "\xff", "version = 1\nimport = 3\nout = 'a'\ntasks = 1"],
)
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(Diff4SplatError, match="expected"):
        read_settings(file)


def test_unknown_data_sets_and_absurd_tasks(tmp_path: Path) -> None:
    file = write_settings(tmp_path, 0)
    with pytest.raises(ConfigError, match="tasks: expected 1 to 1000000, got 0"):
        read_settings(file)
    file.write_text(write_settings(tmp_path, 1).read_text().replace("realestate10k", "realestate"))
    with pytest.raises(ConfigError, match="did you mean"):
        check_settings(read_settings(file))
