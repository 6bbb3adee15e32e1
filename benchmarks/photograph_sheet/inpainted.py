"""What photographs do not show, by rules and by the inpainting network.

Run ``python -m benchmarks.photograph_sheet.inpainted --out inpainted.jpg``: the photograph, then a
view or the end of a motion without the network and with it.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from benchmarks.photograph_sheet.__main__ import ORBITS, QUALITY, from_beside, in_cell, prepared
from benchmarks.photograph_sheet.sources import PHOTOGRAPHS
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.render.api import render

ROWS = (
    ("camera", None),
    ("coffee", None),
    ("astronaut", "the helmet slides to the right"),
    ("motorcycle_left", "the motorcycle moves to the left"),
)
"""Photographs, and what moves; without a prompt the camera does."""
WITHOUT = (("image_inpainting",), ())


def main() -> None:
    """One row for each of ``ROWS``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    pipeline, rows = Diff4SplatPipeline.from_pretrained(arguments.model), []
    by_name = {photograph.name: photograph for photograph in PHOTOGRAPHS}
    for name, prompt in ROWS:
        picture = prepared(by_name[name], arguments.model)
        views = [changed(pipeline, picture, prompt, without) for without in WITHOUT]
        rows.append(np.hstack([_cell(rgb) for rgb in (picture.rgb, *views)]))
    sheet = np.vstack(rows)[..., ::-1]
    cv2.imwrite(str(arguments.out), sheet, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))


@torch.no_grad()
def changed(
    pipeline: Diff4SplatPipeline, picture: InputImage, prompt: str | None, without: tuple[str, ...]
) -> Float[Tensor, "h w 3"]:
    """From 15 degrees beside, or at the end of the motion."""
    settings = GenerationSettings(without=without)
    scene = pipeline(picture, "static", prompt, settings=settings)
    if prompt is not None:
        return render(scene, picture.camera, float(scene.motion.time_range_s[1])).rgb.clamp(0, 1)
    return from_beside(scene, picture, ORBITS[0])


def _cell(rgb: Float[Tensor, "h w 3"]) -> UInt8[np.ndarray, "y x 3"]:
    return in_cell((255 * rgb).round().byte().numpy())


if __name__ == "__main__":
    main()
