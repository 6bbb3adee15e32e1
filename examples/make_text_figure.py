"""Write what three prompts make of one picture, row by row: to the left, to the right, nothing.

Usage: python examples/make_text_figure.py picture.jpg figure.png --thing "a red ball"
"""

import argparse
from pathlib import Path

import torch

from diff4splat import Diff4SplatPipeline
from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.generation.inputs.input_image import load_image
from diff4splat.io.photos.images import write_png
from diff4splat.render.api import render

TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the scene's time."""


def main() -> None:
    """One row per prompt, from the first camera."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--thing", required=True)
    parser.add_argument("--model", default="small")
    options = parser.parse_args()
    pipeline = Diff4SplatPipeline.from_pretrained(options.model)
    side_px, multiple_px = find_image_size(options.model)
    picture = load_image(options.picture, side_px, multiple_px=multiple_px)
    rows = []
    for prompt in (
        f"{options.thing} slides to the left",
        f"{options.thing} slides to the right",
        f"nothing moves around {options.thing}",
    ):
        scene = pipeline(picture, "arc:0.1", prompt)
        last_s = float(scene.path.times_s[-1])
        shown = [render(scene, scene.path.cameras[0], share * last_s).rgb for share in TIMES]
        rows.append(torch.cat(shown, 1).clamp(0, 1))
    write_png(torch.cat(rows), options.out)


if __name__ == "__main__":
    main()
