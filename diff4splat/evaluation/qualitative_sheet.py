"""A page with the best, the median and the worst item: input, truth, answer, depths, baseline.

Axes: ``h w`` pixels. Answers are computed again from their seeds: nothing but numbers is stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.baselines import make_baseline
from diff4splat.evaluation.columns import PRIMARY, SYSTEM
from diff4splat.evaluation.measuring import Setup
from diff4splat.evaluation.predictions import SceneAnswer
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.report_writer import number, subject_name
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.sample import Case, make_case
from diff4splat.evaluation.sources import ClipSource
from diff4splat.evaluation.summary import Summary
from diff4splat.evaluation.text_measures import text_case
from diff4splat.io.depth_colors import colorize, robust_range
from diff4splat.io.sheet_canvas import FAINT, Canvas, Style, fitted

_CELL, _GAP, _MARGIN = 220, 12, 30
_TITLE, _BODY, _SMALL = Style(size_px=30), Style(size_px=18), Style(size_px=15, color=FAINT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """One item's pictures side by side."""

    heading: str
    pictures: tuple[tuple[str, Float[Tensor, "_h _w 3"]], ...]


@torch.no_grad()
def make_strips(outcome: Outcome, summary: Summary, source: ClipSource) -> list[Strip]:
    """Pictures of the items to look at."""
    setup, key = outcome.setup, PRIMARY[outcome.setup.task]
    found = summary.difference(key)
    strips = []
    for name, item in summary.shown():
        case = make_case(
            source.clip(setup.protocol.source.first + item.item), setup.protocol, setup.task
        )
        heading = f"{name}: item {item.item}, {item.clip}, {number(item.value(SYSTEM, key))}"
        pictures = (
            _text_pictures(case, setup)
            if setup.task == "text"
            else _pictures(case, setup, item, found.baseline if found else None)
        )
        strips.append(Strip(heading=heading, pictures=tuple(pictures)))
    return strips


def draw_sheet(outcome: Outcome, strips: Sequence[Strip]) -> Float[Tensor, "h w 3"]:
    """The page; save it with ``write_png``."""
    columns = max((len(strip.pictures) for strip in strips), default=4)
    heights = [_strip_height(strip) for strip in strips]
    size = (2 * _MARGIN + columns * (_CELL + _GAP), 2 * _MARGIN + _TITLE.line_px + sum(heights))
    canvas = Canvas(*size)
    protocol = outcome.setup.protocol
    title = f"{subject_name(outcome)}: {outcome.setup.task} on {protocol.name}"
    canvas.text((_MARGIN, _MARGIN // 2), title, _TITLE)
    y = _MARGIN + _TITLE.line_px
    for strip, height in zip(strips, heights, strict=True):
        _draw_strip(canvas, y, strip)
        y += height
    return canvas.to_rgb()


def _draw_strip(canvas: Canvas, y: int, strip: Strip) -> None:
    canvas.text((_MARGIN, y), strip.heading, _BODY)
    top = y + _BODY.line_px
    for index, (name, picture) in enumerate(strip.pictures):
        x = _MARGIN + index * (_CELL + _GAP)
        size = fitted(picture.shape, (_CELL, _CELL))
        canvas.text((x, top), name, _SMALL)
        canvas.picture((x, top + _SMALL.line_px), size, picture)


def _strip_height(strip: Strip) -> int:
    tallest = max(fitted(picture.shape, (_CELL, _CELL))[1] for _, picture in strip.pictures)
    return _BODY.line_px + _SMALL.line_px + tallest + 2 * _GAP


def _pictures(
    case: Case, setup: Setup, item: ItemResult, baseline: str | None
) -> list[tuple[str, Tensor]]:
    """At the judged picture whose score is the median of the item's."""
    pair = case.judged.pairs[_median_place(item)]
    answer = SceneAnswer(setup.subject.answer(case, setup.protocol.seed))
    look = answer.look(case.camera(pair), case.time_s(pair[1]), pair[1])
    depth = case.true_depth(pair)
    limits = robust_range(depth)
    view, frame = pair
    pictures = [
        ("input", case.input_rgb(case.nearest_input(frame))),
        (f"truth: view {view}, frame {frame}", case.true_rgb(pair)),
        ("answer", look.rgb),
        ("true depth", colorize(depth, limits)),
        ("answer's depth", colorize(look.depth, limits)),
    ]
    if baseline is not None and item.value(baseline, PRIMARY[setup.task]) is not None:
        other = make_baseline(baseline, case, setup.protocol.planes)
        shown = other.look(case.camera(pair), case.time_s(frame), frame)
        pictures.append((baseline, shown.rgb))
    return pictures


def _median_place(item: ItemResult) -> int:
    """Which judged picture has the median score; the only one if there is one."""
    parts = next(s.parts for s in item.scores if (s.row, s.key) == (SYSTEM, "psnr"))
    if not parts:
        return 0
    order = sorted(range(len(parts)), key=lambda place: parts[place] or 0.0)
    return order[len(order) // 2]


def _text_pictures(case: Case, setup: Setup) -> list[tuple[str, Tensor]]:
    """The first picture, and the last moment of the three answers from where it was taken."""
    found, camera = text_case(case), case.input_view.cameras[0]
    pictures = [("input", case.input_rgb(0))]
    for wish in ("left", "right", "still"):
        caption = setup.captioner(case.clip, found.note, wish)
        scene = setup.subject.generate(case, caption, setup.protocol.seed)
        last = case.clip.frames - 1
        pictures.append((caption, SceneAnswer(scene).look(camera, case.time_s(last), last).rgb))
    return pictures
