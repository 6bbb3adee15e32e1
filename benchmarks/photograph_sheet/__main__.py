"""Command line of the sheet: ``python -m benchmarks.photograph_sheet --out sheet.jpg``."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from benchmarks.photograph_sheet.sources import PHOTOGRAPHS, Photograph, load, of_folder
from diff4splat.errors import InputError
from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.generation.inputs.input_image import (
    InputImage,
    choose_focal,
    downsample,
    prepare_image,
)
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.priors import predicted_depth
from diff4splat.models.hub.model import Model, load_model
from diff4splat.paths.build import build_path
from diff4splat.paths.settings import PathSettings
from diff4splat.render.api import render
from diff4splat.scene.extent import scene_frame
from diff4splat.scene.scene import Scene

SIDE_PX = 256
ORBITS = ("orbit:0.0417", "orbit:-0.0417")
"""15 of 360 degrees to each side."""
CELL_PX = (180, 240)
"""Height and width of a picture of the sheet."""
COLUMNS = 2
MOST_UNSURE = 0.5
"""Uncertainty of log depth that is red: off by two thirds."""
QUALITY = 90


def main() -> None:
    """Every photograph, two views beside it, and its depth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--photographs", type=Path, help="folder of others than the twelve")
    parser.add_argument("--side", type=int, default=SIDE_PX, help="of the scenes, in pixels")
    parser.add_argument("--uncertainty", action="store_true", help="depth and how unsure it is")
    arguments = parser.parse_args()
    folder, rows = arguments.photographs, []
    try:
        photographs = PHOTOGRAPHS if folder is None else of_folder(folder)
        row = drawing(arguments.model, arguments.uncertainty)
    except InputError as error:
        parser.error(str(error))
    for photograph in photographs:
        rows.append(row(prepared(photograph, arguments.model, arguments.side)))
        print(photograph.name, flush=True)
    sheet = in_columns(rows)[..., ::-1]
    cv2.imwrite(str(arguments.out), sheet, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))


def drawing(model: str, uncertainty: bool) -> Callable[[InputImage], UInt8[np.ndarray, "h w 3"]]:
    """What makes a row of an image."""
    if not uncertainty:
        return partial(view_row, Diff4SplatPipeline.from_pretrained(model))
    depth = load_model(model, parts=("monocular_depth",))
    if not depth.config.monocular_depth.uncertainty:
        raise InputError(f"--uncertainty: {model} does not predict it; take small")
    return partial(uncertainty_row, depth)


def in_columns(rows: list[UInt8[np.ndarray, "h w 3"]]) -> UInt8[np.ndarray, "y x 3"]:
    """The rows, the first half of them at the left."""
    half = -(-len(rows) // COLUMNS)
    rows = [*rows, *[np.full_like(rows[0], 255)] * (half * COLUMNS - len(rows))]
    return np.hstack([np.vstack(rows[start : start + half]) for start in range(0, len(rows), half)])


def prepared(photograph: Photograph, model: str, side_px: int = SIDE_PX) -> InputImage:
    """The photograph as ``generate --size 256`` takes it, or with another size."""
    pixels = load(photograph)
    focal = choose_focal(pixels.shape[:2], photograph.fov_deg, None)
    rgb = torch.from_numpy(pixels).float() / 255
    return prepare_image(rgb, focal, *find_image_size(model, side_px))


@torch.no_grad()
def view_row(pipeline: Diff4SplatPipeline, picture: InputImage) -> UInt8[np.ndarray, "h w 3"]:
    """The photograph, 15 degrees to one side and to the other, depth."""
    scene = pipeline(picture, "static")
    images = [picture.rgb, *(from_beside(scene, picture, orbit) for orbit in ORBITS)]
    depth = render(scene, picture.camera, outputs=("rgb", "depth")).depth
    cells = [(255 * image).round().byte().numpy() for image in images]
    return np.hstack([in_cell(cell) for cell in (*cells, depth_colors(depth))])


@torch.no_grad()
def from_beside(scene: Scene, picture: InputImage, orbit: str) -> Float[Tensor, "h w 3"]:
    """What a camera sees that has gone along the orbit."""
    path = build_path(orbit, scene_frame(scene, picture.camera), PathSettings(frames=2, fps=1))
    return render(scene, path.cameras[1]).rgb.clamp(0, 1)


@torch.no_grad()
def uncertainty_row(model: Model, picture: InputImage) -> UInt8[np.ndarray, "h w 3"]:
    """The photograph, its depth, and the uncertainty of log depth: blue is sure."""
    found = predicted_depth(model, downsample(picture, 2), is_larger=True)
    share = (found.uncertainty / MOST_UNSURE).clamp(0, 1)
    rgb = (255 * picture.rgb).round().byte().numpy()
    unsure = turbo(share.numpy())
    return np.hstack([in_cell(cell) for cell in (rgb, depth_colors(found.depth), unsure)])


def depth_colors(depth: Float[Tensor, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Near is red; the range of a picture is at least a factor of e^0.3."""
    nearness = -depth.clamp_min(1e-3).log().numpy()
    low, high = np.percentile(nearness, [2, 98])
    share = ((nearness - low) / max(high - low, 0.3)).clip(0, 1)
    return turbo(share)


def turbo(share: Float[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """0 is blue, 1 is red."""
    return cv2.applyColorMap((255 * share).astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1]


def in_cell(image: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "y x 3"]:
    """Scaled to fit, on white."""
    scale = min(CELL_PX[0] / image.shape[0], CELL_PX[1] / image.shape[1])
    size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    cell = np.full((*CELL_PX, 3), 255, np.uint8)
    top, left = (CELL_PX[0] - size[1]) // 2, (CELL_PX[1] - size[0]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    return cell


if __name__ == "__main__":
    main()
