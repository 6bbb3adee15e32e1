"""Means, paired differences, tables and the picture, from scores made up here."""

import json
from pathlib import Path

import pytest
from ablations.course import StageCost
from ablations.drawing import draw_differences
from ablations.evaluation import HeldOut, held_out
from ablations.results import KEYS, Row, difference, mean, store, stored_rows
from ablations.tables import to_json, to_markdown
from ablations.variants import reduced

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.records import ItemResult, Score
from diff4splat.evaluation.systems.baselines import BASELINES, NEAREST

BASE = reduced(recipe_by_name("small"), {"static-low": 300, "motion": 100, "dynamic": 200})
COSTS = (
    StageCost(stage="static-low", steps=300, cpu_s=240.0, shared=True),
    StageCost(stage="motion", steps=90, cpu_s=30.0, shared=False),
    StageCost(stage="dynamic", steps=190, cpu_s=200.0, shared=False),
)


@pytest.fixture(scope="module")
def test_clips() -> HeldOut:
    return held_out((64, 64), 4)


def item(number: int, value: float, keys: tuple[str, ...] = KEYS) -> ItemResult:
    own = [Score(row=SYSTEM, key=key, value=float(value)) for key in keys]
    trivial = Score(row=NEAREST, key="psnr", value=10.0)
    return ItemResult(item=number, clip=f"world {number}", clip_sha256="0", scores=(*own, trivial))


def row(name: str, *values: float, first: int = 0) -> Row:
    items = tuple(item(first + place, value) for place, value in enumerate(values))
    return Row(title=name.replace("-", " "), name=name, items=items, costs=COSTS)


def cells(markdown: str, title: str) -> list[list[str]]:
    """All lines of the tables that begin with the title."""
    lines = [line[2:-2].split(" | ") for line in markdown.splitlines() if line[:1] == "|"]
    return [line[1:] for line in lines if line[0] == title]


def test_differences_are_taken_clip_by_clip(test_clips: HeldOut) -> None:
    full, other = row("full", 20.0, 30.0, 10.0), row("pictures", 21.5, 31.5, 11.5)
    found = difference(other, full, "psnr", test_clips.protocol)
    # A constant gain has no spread, however different the clips are.
    assert (found.value, found.low, found.high, found.count) == (1.5, 1.5, 1.5, 3)
    spread = mean(full, "psnr", test_clips.protocol)
    assert spread.value == 20.0
    assert spread.low < 19
    assert spread.high > 21


def test_only_clips_with_both_values_are_compared(test_clips: HeldOut) -> None:
    full, other = row("full", 1.0, 2.0, 3.0), row("pictures", 5.0, 7.0, first=2)
    assert difference(other, full, "psnr", test_clips.protocol).value == 2.0
    apart = row("pictures", 5.0, first=9)
    assert difference(apart, full, "psnr", test_clips.protocol) is None


def test_a_measure_that_nothing_has_stays_empty(test_clips: HeldOut) -> None:
    bare = Row(title="bare", name="pictures", items=(item(0, 1.0, ("psnr",)),))
    assert mean(bare, "track_error", test_clips.protocol) is None
    markdown = to_markdown([row("full", 2.0), bare], BASE, test_clips.protocol)
    means, differences = cells(markdown, "bare")
    assert means[0] == "1"
    assert means[3] == ""
    assert differences[0] == "-1"


def test_the_table_has_steps_of_every_stage_and_seconds_of_all(test_clips: HeldOut) -> None:
    markdown = to_markdown([row("full", 2.0), row("pictures", 3.0)], BASE, test_clips.protocol)
    means, differences = cells(markdown, "pictures")
    assert means[-2:] == ["300* + 90 + 190", "470"]
    assert differences[0] == "+1"
    assert test_clips.protocol.digest in markdown
    assert "takes 300 steps of static-low, 100 of motion and 200 of dynamic; the others" in markdown


def test_the_full_variant_alone_is_compared_with_nothing(test_clips: HeldOut) -> None:
    markdown = to_markdown([row("full", 2.0)], BASE, test_clips.protocol)
    assert len(cells(markdown, "full")) == 1
    assert "minus full" not in markdown


def test_stored_variants_come_back_in_the_order_of_the_table_before_baselines(
    tmp_path: Path, test_clips: HeldOut
) -> None:
    for name in ("pictures", "full"):
        store(row(name, 1.0, 2.0), tmp_path / name, test_clips)
    found = stored_rows(tmp_path, test_clips)
    assert [one.name for one in found] == ["full", "pictures"] + [""] * len(BASELINES)
    assert found[0] == row("full", 1.0, 2.0)
    nearest = next(one for one in found if one.title == NEAREST)
    assert nearest.values("psnr") == {0: 10.0, 1: 10.0}
    assert nearest.values("track_error") == {}


def test_items_beyond_those_asked_for_are_left_out(tmp_path: Path, test_clips: HeldOut) -> None:
    store(row("full", *range(10)), tmp_path / "full", held_out((64, 64), 10))
    found = stored_rows(tmp_path, test_clips)
    assert len(found[0].items) == test_clips.items == 4


@pytest.mark.parametrize("other", [held_out((32, 32), 4), held_out((64, 64), 3)])
def test_variants_judged_on_other_or_fewer_clips_are_left_out(
    tmp_path: Path, test_clips: HeldOut, other: HeldOut
) -> None:
    store(row("full", 1.0, 2.0), tmp_path / "full", test_clips)
    store(row("pictures", 1.0, 2.0), tmp_path / "pictures", other)
    assert [one.name for one in stored_rows(tmp_path, test_clips) if one.name] == ["full"]


def test_json_holds_every_value_by_clip(test_clips: HeldOut) -> None:
    rows = [row("full", 2.0, 4.0), row("pictures", 3.0, 4.0)]
    record = json.loads(to_json(rows, BASE, test_clips.protocol))
    full, other = record["rows"]
    assert full["values"]["psnr"] == {"0": 2.0, "1": 4.0}
    assert other["differences"]["psnr"]["value"] == 0.5
    assert other["stages"][2] == {
        "stage": "dynamic",
        "steps": 190,
        "cpu_s": 200.0,
        "shared": False,
    }
    assert record["protocol"]["digest"] == test_clips.protocol.digest


def test_the_picture_is_drawn_with_missing_values_and_without_variants(
    tmp_path: Path, test_clips: HeldOut
) -> None:
    bare = Row(title="bare", name="pictures", items=(item(0, 1.0, ("psnr",)),))
    for rows in ([row("full", 2.0, 3.0)], [row("full", 2.0, 3.0), row("no-order", 1.0, 5.0), bare]):
        draw_differences(rows, test_clips.protocol, tmp_path / "picture.png")
        assert (tmp_path / "picture.png").read_bytes()[:4] == b"\x89PNG"
