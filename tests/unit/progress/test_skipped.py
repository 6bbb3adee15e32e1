import json
import math

import pytest

from diff4splat.errors import ConfigError
from diff4splat.progress.skipped import SkippedWork, SkippedWorkList

TEXT = SkippedWork(what="text encoder", why="no prompt given", saved="12,345 parameters")
MOTION = SkippedWork(
    what="deformation",
    why="nothing moves",
    saved="49 evaluations",
    error=2.5e-4,
    error_unit="px",
)


def test_reads_as_one_line() -> None:
    assert str(TEXT) == "text encoder: no prompt given; saved 12,345 parameters; error 0"
    assert str(MOTION) == "deformation: nothing moves; saved 49 evaluations; error 0.00025 px"


def test_keeps_the_order_and_counts_repeats_once() -> None:
    skipped_work = SkippedWorkList()
    for record in (MOTION, TEXT, MOTION):
        skipped_work.add(record)
    assert list(skipped_work) == [MOTION, TEXT]
    assert len(skipped_work) == 2


def test_survives_json() -> None:
    skipped_work = SkippedWorkList()
    skipped_work.add(MOTION)
    assert json.loads(json.dumps(skipped_work.to_json())) == [
        {
            "what": "deformation",
            "why": "nothing moves",
            "saved": "49 evaluations",
            "error": 2.5e-4,
            "error_unit": "px",
        }
    ]
    assert SkippedWorkList().to_json() == []


def test_collections_are_independent() -> None:
    SkippedWorkList().add(TEXT)
    assert len(SkippedWorkList()) == 0


@pytest.mark.parametrize("error", [-1.0, math.nan, math.inf])
def test_refuses_an_error_that_is_none(error: float) -> None:
    with pytest.raises(ConfigError, match="error: expected 0 or above"):
        SkippedWork(what="a", why="b", saved="c", error=error)


def test_refuses_an_error_without_a_unit() -> None:
    with pytest.raises(ConfigError, match="error_unit: expected a unit of 20"):
        SkippedWork(what="a", why="b", saved="c", error=20.0)


@pytest.mark.parametrize("field", ["what", "why", "saved"])
def test_refuses_to_say_nothing(field: str) -> None:
    words = {"what": "a", "why": "b", "saved": "c", field: ""}
    with pytest.raises(ConfigError, match="expected what, why and saved in words"):
        SkippedWork(**words)
