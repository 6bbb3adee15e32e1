"""Means, intervals, differences, and the table as people read it."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import Fixed, tiny_protocol, wall_and_patch

from diff4splat import __version__
from diff4splat.evaluation.columns import COLUMNS, SYSTEM, column_of
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.records import (
    Failure,
    ItemResult,
    Score,
    Skip,
    read_item,
    score,
)
from diff4splat.evaluation.report.difference_chart import difference_chart
from diff4splat.evaluation.report.report_writer import to_markdown
from diff4splat.evaluation.report.summary import interval, paired_differences, summarize
from diff4splat.evaluation.runner import Outcome

NEAREST, PLANE = "nearest frame", "mean-depth plane"


class Untrained(Fixed):
    identity = replace(Fixed(wall_and_patch()).identity, name="small", untrained=True)


def item(number: int, **values: tuple[float, float]) -> ItemResult:
    """Scores of the system and of the nearest frame."""
    scores = [
        Score(row=row, key=key, value=value)
        for key, pair in values.items()
        for row, value in zip((SYSTEM, NEAREST), pair, strict=True)
    ]
    return ItemResult(
        item=number, clip=f"clip-{number}", clip_sha256="0" * 16, scores=tuple(scores)
    )


def outcome(*items: ItemResult, failures: tuple[Failure, ...] = ()) -> Outcome:
    setup = Setup(protocol=tiny_protocol(), task="generation", system=Untrained(wall_and_patch()))
    return Outcome(setup=setup, items=items, failures=failures, requested=2, resumed=0)


GOLDEN = f"""# Evaluation: small (untrained), generation

Protocol tiny, digest `DIGEST`; 2 of 2 items (**subset**: the first 2 of 3; not comparable). \
Weights random, configuration `ffffffffffff`. diff4splat {__version__}.
**Untrained**: the weights are random; this row is a starting point.

Means over items with 95% bootstrap intervals.

|  | PSNR [dB] ↑ | track EPE ↓ |
| --- | ---: | ---: |
| **small (untrained)** | 22 [22, 22] | 0.25 |
| nearest frame | 20 [20, 20] | 0.5 |

Item by item against the best baseline of each measure; above 0 the system is better.

| measure | best baseline | difference | items |
| --- | --- | ---: | ---: |
| PSNR [dB] | nearest frame | +2 [+2, +2] | 2 |
| track EPE | nearest frame | +0.25 | 1 |

- PSNR [dB]: {column_of("psnr").meaning}.
- track EPE: {column_of("track_error").meaning}.
- The best plane is an oracle: it selects its depth with the target images.

- best: item 0 (clip-0), 22 PSNR [dB]
- worst: item 1 (clip-1), 22 PSNR [dB]

- failed: item 2 (clip-2): too short
- not measured on 1 items: track_error of system: no tracks
"""


def test_the_table_is_the_golden_one() -> None:
    first = item(0, psnr=(22.0, 20.0), track_error=(0.25, 0.5))
    skip = Skip(row=SYSTEM, key="track_error", why="no tracks")
    second = replace(item(1, psnr=(22.0, 20.0)), skips=(skip,))
    run = outcome(first, second, failures=(Failure(item=2, clip="clip-2", why="too short"),))
    expected = GOLDEN.replace("DIGEST", run.setup.protocol.digest)
    assert to_markdown(run, summarize(run)) == expected


def test_the_best_baseline_is_best_in_the_direction_of_its_column() -> None:
    extra = tuple(
        Score(row=PLANE, key=key, value=value)
        for key, value in (("psnr", 21.0), ("depth_absrel", 0.3))
    )
    one = item(0, psnr=(22.0, 20.0), depth_absrel=(0.2, 0.1))
    run = outcome(replace(one, scores=one.scores + extra))
    summary = summarize(run)
    assert summary.difference("psnr").baseline == PLANE
    assert summary.difference("psnr").mean.value == pytest.approx(1)
    assert summary.difference("depth_absrel").baseline == NEAREST
    assert summary.difference("depth_absrel").mean.value == pytest.approx(-0.1)
    assert summary.difference("ssim") is None


def test_differences_pair_items_and_leave_out_what_has_no_partner() -> None:
    lonely = ItemResult(
        item=2, clip="c", clip_sha256="", scores=(Score(row=SYSTEM, key="psnr", value=99.0),)
    )
    items = (item(0, psnr=(10.0, 30.0)), item(1, psnr=(30.0, 10.0)), lonely)
    assert paired_differences(items, column_of("psnr"), NEAREST) == [-20, 20]


def test_ranking_runs_from_best_to_worst() -> None:
    items = tuple(
        item(i, psnr=(value, 0.0)) for i, value in enumerate((20.0, 25.0, 15.0, 18.0, 30.0))
    )
    shown = summarize(outcome(*items)).examples()
    assert [(name, one.item) for name, one in shown] == [("best", 4), ("median", 0), ("worst", 2)]
    assert [name for name, _ in summarize(outcome(*items[:1])).examples()] == ["best"]
    assert summarize(outcome()).examples() == ()


def test_intervals_cover_the_true_mean_about_as_often_as_they_say() -> None:
    generator = torch.Generator().manual_seed(3)
    protocol = tiny_protocol()
    samples = torch.randn(200, 24, generator=generator).double()
    intervals = [interval(sample.tolist(), protocol) for sample in samples]
    covered = sum(one.low <= 0 <= one.high for one in intervals)
    assert 0.88 <= covered / 200 <= 0.99
    assert interval([1.5], protocol).low is None


def test_scores_leave_out_what_is_not_finite_and_say_when_nothing_is_left() -> None:
    mixed = score("row", "psnr", [10.0, float("nan"), 20.0])
    assert (mixed.value, mixed.parts) == (15, (10.0, None, 20.0))
    assert score("row", "psnr", [float("nan")]) == Skip(
        row="row", key="psnr", why="no image allows it"
    )


def test_items_come_back_unchanged() -> None:
    one = ItemResult(
        item=3,
        clip="c",
        clip_sha256="d",
        scores=(score("row", "psnr", [1.25, float("nan")]),),
        skips=(Skip(row="row", key="ssim", why="so"),),
    )
    assert read_item(one.to_json(), "here") == one


def test_every_column_has_one_key_and_one_direction() -> None:
    assert len({column.key for column in COLUMNS}) == len(COLUMNS)
    assert {column.sign for column in COLUMNS} == {-1, 0, 1}


def test_what_is_neither_better_nor_worse_has_no_arrow_and_no_winner() -> None:
    run = outcome(item(0, psnr=(22.0, 20.0), covisible_share=(0.5, 0.5)))
    summary = summarize(run)
    assert summary.difference("covisible_share") is None
    table = to_markdown(run, summary)
    assert "|  | PSNR [dB] ↑ | seen |\n" in table
    assert "| nearest frame | 20 | 0.5 |\n" in table
    assert "| seen | nearest frame |" not in table


@pytest.mark.parametrize("values", [[], [0.0], [-1.0, 2.0, 0.5] * 40])
def test_charts_are_drawn_for_any_number_of_items(values: list[float]) -> None:
    image = difference_chart(values, "title")
    assert image.shape == (420, 960, 3)
    assert bool(torch.isfinite(image).all())


def test_bars_above_the_line_are_wins() -> None:
    wins, losses = difference_chart([1.0], "t"), difference_chart([-1.0], "t")
    assert float(wins[120, 400, 2]) > 0.8, "blue above"
    assert float(wins[280, 400].amax()) < 0.2
    assert float(losses[280, 400, 0]) > 0.7, "orange below"
    assert float(losses[120, 400].amax()) < 0.2
