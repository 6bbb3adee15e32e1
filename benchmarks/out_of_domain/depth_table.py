"""Depth of path-traced images and of photographs: error, and agreement with itself.

A ramp of the image row is the row to beat: it does not look at the image. Axes: ``h w`` pixels.
"""

import argparse
import statistics
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth_prediction import predict_depth
from diff4splat.io.atomic import write_text
from diff4splat.models.hub.model import load_model
from diff4splat.training.batches.random_images.photographs import middle_square

Predict = Callable[[Float[Tensor, "h w 3"]], Float[Tensor, "h w"]]
HEADER = (
    "| depth | px | AbsRel | r of log depth | mirrored | middle 60 % | at 3/4 |\n"
    "|---|---:|---:|---:|---:|---:|---:|\n"
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
    def predict(rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
        small = _resized(rgb.movedim(-1, 0), (side, side)).movedim(0, -1)
        return _resized(predict_depth(network, small, config).depth[None], rgb.shape[:2])[0]

    return predict


def _ramp(rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
    height = rgb.shape[0]
    row = (torch.arange(height) + 0.5) / height
    return (1 / (0.2 + row))[:, None].expand(rgb.shape[:2]).contiguous()


def _row(name: str, side: str, predict: Predict, images, photos) -> str:
    errors, correlations = zip(
        *(_errors(predict(rgb), depth) for rgb, depth in images), strict=True
    )
    agree = [_agreement(predict, rgb) for rgb in photos]
    cells = [statistics.mean(errors), statistics.mean(correlations)]
    cells += [statistics.mean(column) for column in zip(*agree, strict=True)]
    return f"| {name} | {side} | " + " | ".join(f"{cell:.3f}" for cell in cells) + " |"


def _errors(depth: Float[Tensor, "h w"], truth: Float[Tensor, "h w"]) -> tuple[float, float]:
    """Relative error after median scaling, and the correlation of log depth."""
    known = truth > 0
    depth, truth = depth[known], truth[known]
    depth = depth * (truth.median() / depth.median())
    return float(((depth - truth).abs() / truth).mean()), _pearson(depth.log(), truth.log())


def _agreement(predict: Predict, rgb: Float[Tensor, "h w 3"]) -> tuple[float, float, float]:
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
