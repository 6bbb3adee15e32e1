"""Photographs from beside, with round Gaussians alone and with those of steep surfaces in them.

Run ``python -m benchmarks.photograph_sheet.steep_surfaces --out steep-surfaces.jpg``, after
``pip install scikit-learn``: the photograph, then a view from 15 degrees beside.
"""

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from benchmarks.photograph_sheet.__main__ import ORBITS, QUALITY, from_beside, prepared
from benchmarks.photograph_sheet.sources import Photograph
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image import steep_surface
from diff4splat.generation.pipeline import Diff4SplatPipeline

PHOTOGRAPHS = (
    Photograph(name="flower", package="sklearn", file="datasets/images/flower.jpg"),
    Photograph(name="china", package="sklearn", file="datasets/images/china.jpg"),
)
"""Both CC BY 2.0: by vultilion and by danielbuechele."""
SIDE_PX = 512
WIDTH_PX = 480
"""Of a picture of the sheet."""


def main() -> None:
    """One row for each of ``PHOTOGRAPHS``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    pipeline, rows = Diff4SplatPipeline.from_pretrained(arguments.model), []
    for photograph in PHOTOGRAPHS:
        picture = prepared(photograph, arguments.model, SIDE_PX)
        with round_gaussians():
            before = view(pipeline, picture)
        views = (picture.rgb, before, view(pipeline, picture))
        rows.append(np.hstack([_cell(rgb) for rgb in views]))
    sheet = np.vstack(rows)[..., ::-1]
    cv2.imwrite(str(arguments.out), sheet, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))


@contextmanager
def round_gaussians() -> Iterator[None]:
    """No surface counts as steep."""
    least = steep_surface.LEAST_SLOPE
    steep_surface.LEAST_SLOPE = math.inf
    try:
        yield
    finally:
        steep_surface.LEAST_SLOPE = least


def view(pipeline: Diff4SplatPipeline, picture: InputImage) -> Float[Tensor, "h w 3"]:
    """A scene of the photograph, from 15 degrees beside."""
    return from_beside(pipeline(picture, "static"), picture, ORBITS[1])


def _cell(rgb: Float[Tensor, "h w 3"]) -> UInt8[np.ndarray, "y x 3"]:
    size = (WIDTH_PX, round(rgb.shape[0] * WIDTH_PX / rgb.shape[1]))
    return cv2.resize((255 * rgb).round().byte().numpy(), size, interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main()
