"""A page with the best, median and worst item: input, truth, prediction, depths, baseline.

Axes: ``h w`` pixels. Predictions are computed again from their seeds: only numbers are stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.columns import PRIMARY, SYSTEM
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.measures.text import text_sample
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample
from diff4splat.evaluation.protocols.sources import ClipSource
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.report.cells import number, system_name
from diff4splat.evaluation.report.summary import Summary
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.systems.baselines import make_baseline
from diff4splat.evaluation.systems.predictions import ScenePrediction
from diff4splat.io.figures.depth_colors import colorize, robust_range
from diff4splat.io.figures.page_layout import FAINT, Canvas, Style, fitted

_CELL, _GAP, _MARGIN = 220, 12, 30
_TITLE, _BODY, _SMALL = Style(size_px=30), Style(size_px=18), Style(size_px=15, color=FAINT)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageStrip:
    """The images of one item, side by side."""

    heading: str
    images: tuple[tuple[str, Float[Tensor, "_h _w 3"]], ...]


@torch.no_grad()
def make_strips(outcome: Outcome, summary: Summary, source: ClipSource) -> list[ImageStrip]:
    """Images of the best, median and worst item."""
    setup, key = outcome.setup, PRIMARY[outcome.setup.task]
    difference = summary.difference(key)
    strips = []
    for name, item in summary.examples():
        sample = make_sample(
            source.clip(setup.protocol.source.first + item.item), setup.protocol, setup.task
        )
        heading = f"{name}: item {item.item}, {item.clip}, {number(item.value(SYSTEM, key))}"
        images = (
            _text_images(sample, setup)
            if setup.task == "text"
            else _item_images(sample, setup, item, difference.baseline if difference else None)
        )
        strips.append(ImageStrip(heading=heading, images=tuple(images)))
    return strips


def draw_sheet(outcome: Outcome, strips: Sequence[ImageStrip]) -> Float[Tensor, "h w 3"]:
    """Draw the page; save it with ``write_png``."""
    columns = max((len(strip.images) for strip in strips), default=4)
    heights = [_strip_height(strip) for strip in strips]
    size = (2 * _MARGIN + columns * (_CELL + _GAP), 2 * _MARGIN + _TITLE.line_px + sum(heights))
    canvas = Canvas(*size)
    protocol = outcome.setup.protocol
    title = f"{system_name(outcome)}: {outcome.setup.task} on {protocol.name}"
    canvas.text((_MARGIN, _MARGIN // 2), title, _TITLE)
    y = _MARGIN + _TITLE.line_px
    for strip, height in zip(strips, heights, strict=True):
        _draw_strip(canvas, y, strip)
        y += height
    return canvas.to_rgb()


def _draw_strip(canvas: Canvas, y: int, strip: ImageStrip) -> None:
    canvas.text((_MARGIN, y), strip.heading, _BODY)
    top = y + _BODY.line_px
    for index, (name, image) in enumerate(strip.images):
        x = _MARGIN + index * (_CELL + _GAP)
        size = fitted(image.shape, (_CELL, _CELL))
        canvas.text((x, top), name, _SMALL)
        canvas.image((x, top + _SMALL.line_px), size, image)


def _strip_height(strip: ImageStrip) -> int:
    tallest = max(fitted(image.shape, (_CELL, _CELL))[1] for _, image in strip.images)
    return _BODY.line_px + _SMALL.line_px + tallest + 2 * _GAP


def _item_images(
    sample: EvalSample, setup: Setup, item: ItemResult, baseline: str | None
) -> list[tuple[str, Tensor]]:
    """Images of the target image whose score is the median of the item."""
    pair = sample.targets.pairs[_median_index(item)]
    prediction = ScenePrediction(setup.system.predict(sample, setup.protocol.seed))
    rendered = prediction.render(sample.camera(pair), sample.time_s(pair[1]), pair[1])
    depth = sample.true_depth(pair)
    limits = robust_range(depth)
    view, frame = pair
    images = [
        ("input", sample.input_rgb(sample.nearest_input(frame))),
        (f"truth: view {view}, frame {frame}", sample.true_rgb(pair)),
        ("prediction", rendered.rgb),
        ("true depth", colorize(depth, limits)),
        ("predicted depth", colorize(rendered.depth, limits)),
    ]
    if baseline is not None and item.value(baseline, PRIMARY[setup.task]) is not None:
        baseline_prediction = make_baseline(baseline, sample, setup.protocol.planes)
        baseline_view = baseline_prediction.render(sample.camera(pair), sample.time_s(frame), frame)
        images.append((baseline, baseline_view.rgb))
    return images


def _median_index(item: ItemResult) -> int:
    """Index of the target image with the median score; 0 if there is only one."""
    parts = next(s.parts for s in item.scores if (s.row, s.key) == (SYSTEM, "psnr"))
    if not parts:
        return 0
    order = sorted(range(len(parts)), key=lambda index: parts[index] or 0.0)
    return order[len(order) // 2]


def _text_images(sample: EvalSample, setup: Setup) -> list[tuple[str, Tensor]]:
    """The first image, and the last frame of the three predictions from the same camera."""
    target, camera = text_sample(sample), sample.input_view.cameras[0]
    images = [("input", sample.input_rgb(0))]
    for motion in ("left", "right", "still"):
        caption = setup.captioner(sample.clip, target.note, motion)
        scene = setup.system.generate(sample, caption, setup.protocol.seed)
        last = sample.clip.frames - 1
        view = ScenePrediction(scene).render(camera, sample.time_s(last), last)
        images.append((caption, view.rgb))
    return images
