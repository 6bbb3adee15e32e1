"""Images to look at while a model learns: rows of frames, everything at one size.

Axes: ``b`` batch, ``m p`` targets, ``h w`` pixels; all panels show the first sample of a batch.
"""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.io.figures.depth_colors import colorize, robust_range
from diff4splat.io.pixels import from_bytes, unit_rgb
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stages.scene_prediction import RenderedScenes

GAP_PX, LABEL_PX = 2, 14
MOTION_CONTRAST = 0.1
"""Change of a colour, in [0, 1], for a motion of 1."""
LEAST_PX = 96
"""Smaller images are enlarged by a whole factor, so that people see their pixels."""

MOST_PROMPTS = 6
"""Prompts of one image that a panel shows."""

Row = tuple[str, Sequence[Float[Tensor, "h w 3"]]]
"""What a row shows, and its images."""


def preview(rows: Sequence[Row]) -> Float[Tensor, "height width 3"]:
    """Labelled rows of images on white; short rows are filled up."""
    longest = max(len(row) for _, row in rows)
    blank = torch.ones_like(rows[0][1][0])
    lines = []
    for label, row in rows:
        line = _beside([image.cpu() for image in (*row, *[blank] * (longest - len(row)))])
        lines += [_label(label, line.shape[1]), line]
    return torch.cat(lines)


def _beside(row: Sequence[Float[Tensor, "h w 3"]]) -> Float[Tensor, "height width 3"]:
    factor = -(-LEAST_PX // row[0].shape[0])
    large = [one.repeat_interleave(factor, 0).repeat_interleave(factor, 1) for one in row]
    padded = [
        torch.nn.functional.pad(one, (0, 0, 0, GAP_PX, 0, GAP_PX), value=1.0) for one in large
    ]
    return torch.cat(padded, 1)


def _label(text: str, width: int) -> Float[Tensor, "h width 3"]:
    strip = np.full((LABEL_PX, width, 3), 255, np.uint8)
    place = (2, LABEL_PX - 4)
    cv2.putText(strip, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.35, (0, 0, 0), 1, cv2.LINE_AA)
    return from_bytes(strip)


def reconstruction_preview(rendered: RenderedScenes, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
    """Input frames, then truth and prediction of every target, their depths, and motion."""
    truth = list(unit_rgb(batch.target_rgb[0]).flatten(0, 1))
    shown = list(rendered.rgb[0].clamp(0, 1).flatten(0, 1).cpu())
    places = torch.linspace(0, batch.video.shape[1] - 1, len(truth)).round().long()
    rows: list[Row] = [
        ("input", list(unit_rgb(batch.video[0, places]))),
        ("truth", truth),
        ("prediction", shown),
        ("true depth", _depth_row(batch.target_depth[0].flatten(0, 1))),
        ("depth", _depth_row(rendered.depth[0].flatten(0, 1))),
    ]
    if rendered.offsets is not None:
        rows += motion_rows(rendered.offsets[0], batch)
    return preview(rows)


def _depth_row(depth: Float[Tensor, "k h w"]) -> list[Tensor]:
    """In the colours of its own range: scale is not learnt, so only shapes compare."""
    return list(colorize(depth.cpu(), robust_range(depth.cpu())))


def motion_rows(offsets: Float[Tensor, "m n 3"], batch: ClipBatch) -> list[Row]:
    """True and predicted displacement of the tracked points, drawn over the first input frame."""
    truth, valid = batch.track_offset[0], batch.track_valid[0]
    background = unit_rgb(batch.video[0, 0]).mean(-1, keepdim=True).expand(-1, -1, 3) * 0.5
    named = (("true motion", truth), ("motion", offsets))
    return [
        (name, [_arrows(background, batch, offset, valid) for offset in moved])
        for name, moved in named
    ]


def _arrows(
    background: Float[Tensor, "h w 3"],
    batch: ClipBatch,
    offset: Float[Tensor, "n 3"],
    valid: Bool[Tensor, " n"],
) -> Float[Tensor, "h w 3"]:
    """Displacements across the image as lines, coloured by direction."""
    # A copy of its own: lines of one image must not show in the next.
    canvas = background.cpu().numpy().copy()
    scale = float(batch.cameras.focal_px[0, 0, 0]) / 4
    for (_, row, column), shift in zip(
        batch.track_cell[0][valid].tolist(), offset[valid].detach().tolist(), strict=True
    ):
        hue = (math.degrees(math.atan2(shift[1], shift[0])) % 360) / 2
        color = cv2.cvtColor(np.uint8([[[hue, 255, 255]]]), cv2.COLOR_HSV2RGB)[0, 0] / 255
        end = (round(column + scale * shift[0]), round(row + scale * shift[1]))
        cv2.line(canvas, (column, row), end, color.tolist(), 1)
    return torch.from_numpy(canvas)


def motion_preview(
    truth: Float[Tensor, "b 3 t1 hc wc"],
    predicted: Float[Tensor, "b 3 t1 hc wc"],
    batch: ClipBatch,
) -> Float[Tensor, "height width 3"]:
    """First images of all samples, and true and predicted motion at the end of the clip."""
    rows: list[Row] = [
        ("image", list(unit_rgb(batch.video[:, 0]))),
        ("motion: red right, green down, blue away", _motion_colors(truth, batch)),
        ("prediction from noise", _motion_colors(predicted, batch)),
    ]
    return preview(rows)


def _motion_colors(motion: Float[Tensor, "b 3 t1 hc wc"], batch: ClipBatch) -> list[Tensor]:
    """Motion at the end of the clip as colours, grey where nothing moves."""
    last = (0.5 + MOTION_CONTRAST * motion[:, :, -1]).clamp(0, 1)
    side = batch.video.shape[2] // last.shape[2]
    large = last.repeat_interleave(side, 2).repeat_interleave(side, 3)
    return list(large.movedim(1, -1).cpu())


def depth_preview(
    rgb: Float[Tensor, "n 3 h w"],
    true_log_depth: Float[Tensor, "n h w"],
    log_depth: Float[Tensor, "n h w"],
) -> Float[Tensor, "height width 3"]:
    """Images with true and predicted depth: near is bright; an infinite depth is black."""
    rows: list[Row] = [
        ("image", list(rgb.movedim(1, -1).cpu())),
        ("true depth", _near_is_bright(true_log_depth)),
        ("depth", _near_is_bright(log_depth)),
    ]
    return preview(rows)


def _near_is_bright(log_depth: Float[Tensor, "n h w"]) -> list[Tensor]:
    near = torch.sigmoid(math.log(PLANE_DEPTH) - log_depth)
    return list(near[..., None].expand(-1, -1, -1, 3).cpu())


def mask_preview(
    rgb: Float[Tensor, "b 3 h w"],
    masks: Bool[Tensor, "b r h w"],
    probabilities: Float[Tensor, "b r h w"],
) -> Float[Tensor, "height width 3"]:
    """The first image, and for some of its prompts what is asked for and what is found."""
    image = rgb[0].movedim(0, -1)
    return preview(
        [
            ("image", [image]),
            ("asked for", [_dimmed(image, one.to(image)) for one in masks[0, :MOST_PROMPTS]]),
            ("found", [_dimmed(image, one.to(image)) for one in probabilities[0, :MOST_PROMPTS]]),
        ]
    )


def _dimmed(image: Float[Tensor, "h w 3"], mask: Float[Tensor, "h w"]) -> Float[Tensor, "h w 3"]:
    """Dark where the mask is 0."""
    return image * (0.15 + 0.85 * mask[..., None])
