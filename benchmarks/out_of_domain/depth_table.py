"""Depth of path-traced images and of photographs: error, and agreement with itself.

A ramp of the image row is the row to beat: it does not look at the image. Of the uncertainty of a
prior: its rank correlation with the error of log depth within an image, and the mean error of the
surer half of the pixels as a share of the mean error. Axes: ``h w`` pixels.
"""

import argparse
import statistics
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth.prediction import predict_depth
from diff4splat.io.atomic import write_text
from diff4splat.models.hub.model import load_model
from diff4splat.training.batches.random_images.photographs import middle_square

Maps = tuple[Float[Tensor, "h w"], Float[Tensor, "h w"] | None]
"""Depth, and its uncertainty."""
Predict = Callable[[Float[Tensor, "h w 3"]], Maps]
HEADER = (
    "| depth | px | AbsRel | r of log depth | mirrored | middle 60 % | at 3/4 | "
    "uncertainty: rank | surer half |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|\n"
)


def write_depth_table(arguments: argparse.Namespace) -> None:
    """One row per model and input side, and the row ramp."""
    images = [_load(file) for file in sorted(arguments.images.glob("*.npz"))]
    photos = _photographs()
    rows = [_row("ramp of the image row", "", _ramp, images, photos)]
    for name in arguments.model:
        model = load_model(name, parts=("monocular_depth",))
        for side in arguments.sides:
            rows.append(_row(name, str(side), _predictor(model, side), images, photos))
    write_text(arguments.out, HEADER + "\n".join(rows) + "\n")
    print(HEADER + "\n".join(rows))


def _predictor(model, side: int) -> Predict:
    network, config = model.networks.monocular_depth, model.config.activation

    @torch.no_grad()
    def predict(rgb: Float[Tensor, "h w 3"]) -> Maps:
        small = _resized(rgb.movedim(-1, 0), (side, side)).movedim(0, -1)
        found = predict_depth(network, small, config)
        maps = [found.depth, found.uncertainty]
        return tuple(m if m is None else _resized(m[None], rgb.shape[:2])[0] for m in maps)

    return predict


def _ramp(rgb: Float[Tensor, "h w 3"]) -> Maps:
    height = rgb.shape[0]
    row = (torch.arange(height) + 0.5) / height
    return (1 / (0.2 + row))[:, None].expand(rgb.shape[:2]).contiguous(), None


def _row(name: str, side: str, predict: Predict, images, photos) -> str:
    found = [(*predict(rgb), depth) for rgb, depth in images]
    columns = [*zip(*(_errors(depth, truth) for depth, _, truth in found), strict=True)]
    depth_of = partial(_depth_of, predict)
    columns += zip(*(_agreement(depth_of, rgb) for rgb in photos), strict=True)
    if found[0][1] is not None:
        columns += zip(*(_knowledge(*one) for one in found), strict=True)
    cells = [f"{statistics.mean(column):.3f}" for column in columns]
    cells += [""] * (7 - len(cells))
    return f"| {name} | {side} | " + " | ".join(cells) + " |"


def _depth_of(predict: Predict, rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
    return predict(rgb)[0]


def _errors(depth: Float[Tensor, "h w"], truth: Float[Tensor, "h w"]) -> tuple[float, float]:
    """Relative error after median scaling, and the correlation of log depth."""
    known = truth > 0
    depth, truth = depth[known], truth[known]
    depth = depth * (truth.median() / depth.median())
    return float(((depth - truth).abs() / truth).mean()), _pearson(depth.log(), truth.log())


def _knowledge(
    depth: Float[Tensor, "h w"], uncertainty: Float[Tensor, "h w"], truth: Float[Tensor, "h w"]
) -> tuple[float, float]:
    """Rank correlation of uncertainty and error, and the error of the surer half over all."""
    known = truth > 0
    error = depth[known].log() - truth[known].log()
    error = (error - error.median()).abs()
    order = uncertainty[known].argsort()
    surer = error[order[: len(order) // 2]].mean() / error.mean()
    ranks = [values.argsort().argsort().float() for values in (uncertainty[known], error)]
    return _pearson(*ranks), float(surer)


def _agreement(
    predict: Callable[[Float[Tensor, "h w 3"]], Float[Tensor, "h w"]], rgb: Float[Tensor, "h w 3"]
) -> tuple[float, float, float]:
    """Correlation of log depth with that of the mirrored, the cropped and the reduced image."""
    whole = predict(rgb).log()
    mirrored = predict(rgb.flip(1)).flip(1).log()
    height, width = rgb.shape[:2]
    rows, columns = (slice(int(0.2 * side), int(0.8 * side)) for side in (height, width))
    middle = predict(rgb[rows, columns]).log()
    reduced = _resized(rgb.movedim(-1, 0), (height * 3 // 4, width * 3 // 4)).movedim(0, -1)
    reduced = _resized(predict(reduced).log()[None], (height, width))[0]
    return (
        _pearson(mirrored, whole), _pearson(middle, whole[rows, columns]), _pearson(reduced, whole),
    )  # fmt: skip


def _pearson(a: Tensor, b: Tensor) -> float:
    return float(torch.corrcoef(torch.stack([a.flatten(), b.flatten()]))[0, 1].nan_to_num())


def _resized(maps: Float[Tensor, "c h w"], size: tuple[int, int]) -> Float[Tensor, "c h2 w2"]:
    return torch.nn.functional.interpolate(
        maps[None], size, mode="bilinear", align_corners=False, antialias=True
    )[0]


def _load(file: Path) -> tuple[Float[Tensor, "h w 3"], Float[Tensor, "h w"]]:
    with np.load(file, allow_pickle=False) as arrays:
        return torch.from_numpy(arrays["rgb"]).float() / 255, torch.from_numpy(arrays["depth"])


def _photographs() -> list[Float[Tensor, "h w 3"]]:
    """Photographs of scikit-image, their middle square at 256 px."""
    from skimage import data

    photos = [data.astronaut(), data.chelsea(), data.coffee(), data.rocket()]
    unit = [torch.from_numpy(photo[..., :3].copy()).float() / 255 for photo in photos]
    return [middle_square(photo, 256).movedim(0, -1) for photo in unit]
