"""What lets the next stage begin, and what people are told when nothing does."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from toy_training import Toy

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.training.recipe.stage import Gate
from diff4splat.training.trainer.gates import (
    StoredResult,
    read_result,
    stage_may_start,
    write_result,
)
from diff4splat.training.trainer.logs.run_files import RESULT_FILE

RESULT = StoredResult(
    stage="toy", finished=True, step=6, checkpoint="c", measures={"psnr": 20.0, "error_px": 1.5}
)
RECIPE = replace(
    Toy().recipe(),
    gates=(
        Gate(measure="psnr", bound=20.0),
        Gate(measure="error_px", bound=2.0, direction="at_most"),
    ),
)


def test_a_result_survives_the_file(tmp_path) -> None:
    result = replace(RESULT, measures={"psnr": float("nan")})
    write_result(tmp_path, result)
    assert read_result(tmp_path) == replace(RESULT, measures={"psnr": None})


def test_a_stage_that_reached_its_gates_lets_the_next_begin(tmp_path) -> None:
    write_result(tmp_path, RESULT)
    stage_may_start(RECIPE, tmp_path)


@pytest.mark.parametrize(
    ("measures", "said"),
    [
        ({"psnr": 18.5, "error_px": 1.0}, "expected psnr at least 20, got 18.5, 1.5 short"),
        ({"psnr": 21.0, "error_px": 2.25}, "expected error_px at most 2, got 2.25, 0.25 short"),
        ({"psnr": 21.0}, r"error_px at most 2, got no such finite measure \(there are: psnr\)"),
        (
            {"psnr": None, "error_px": 1.0},
            r"psnr .*finite measure \(there are: error_px\)",
        ),
    ],
)
def test_a_measure_that_fell_short_is_named_with_the_way_out(tmp_path, measures, said: str) -> None:
    write_result(tmp_path, replace(RESULT, measures=measures))
    with pytest.raises(ConfigError, match=f"stage toy: .*{said}.*--ignore-gates"):
        stage_may_start(RECIPE, tmp_path)
    stage_may_start(RECIPE, tmp_path, override=True)


def test_a_stage_that_is_not_over_is_not_enough(tmp_path) -> None:
    write_result(tmp_path, replace(RESULT, finished=False, step=4))
    with pytest.raises(ConfigError, match="expected 6 steps before the next stage, got 4"):
        stage_may_start(RECIPE, tmp_path)


def test_a_stage_that_never_began_is_never_enough(tmp_path) -> None:
    with pytest.raises(ConfigError, match="train that stage first"):
        stage_may_start(RECIPE, tmp_path, override=True)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"measures": {}, "colour": 1}', "nul\0"])
def test_a_damaged_result_is_named(tmp_path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)
    with pytest.raises(FileFormatError, match="expected the result of a stage"):
        stage_may_start(RECIPE, tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        *({"step": "6"}, {"step": True}, {"finished": 1}, {"stage": None}, {"other": 1}),
        *({"checkpoint": "../a"}, {"checkpoint": "a" * 300}, {"checkpoint": ""}),
        *({"measures": {"psnr": "20"}}, {"measures": {"psnr": 10**400}}, {"measures": []}),
    ],
)
def test_a_result_of_other_values_is_refused(tmp_path: Path, change: dict) -> None:
    write_result(tmp_path, RESULT)
    file = tmp_path / RESULT_FILE
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(FileFormatError, match="expected the result of a stage"):
        read_result(tmp_path)
