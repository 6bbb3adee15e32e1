"""Write what prompts make of one picture, row by row.

Usage: python examples/make_text_figure.py picture.jpg figure.png --thing "a red ball"
       python examples/make_text_figure.py picture.jpg figure.png --prompts "a red ball rolls" ...
       ... --ablate object_shadow   # every row once more, without that network

A thing stands for three prompts: it slides to the left, to the right, nothing moves around it.
"""

import argparse
from pathlib import Path

import torch

from diff4splat import Diff4SplatPipeline
from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.generation.inputs.input_image import load_image
from diff4splat.generation.settings import GenerationSettings
from diff4splat.io.photos.images import write_png
from diff4splat.render.api import render

TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the scene's time."""


def prompts_about(thing: str) -> list[str]:
    """To the left, to the right, nothing."""
    slides = [f"{thing} slides to the {side}" for side in ("left", "right")]
    return [*slides, f"nothing moves around {thing}"]


def main() -> None:
    """One row per prompt, from the first camera."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.add_mutually_exclusive_group(required=True)
    asked.add_argument("--thing")
    asked.add_argument("--prompts", nargs="+")
    parser.add_argument("--model", default="small")
    parser.add_argument("--ablate", default="", help="a network that is left out in a second row")
    options = parser.parse_args()
    pipeline = Diff4SplatPipeline.from_pretrained(options.model)
    side_px, multiple_px = find_image_size(options.model)
    picture = load_image(options.picture, side_px, multiple_px=multiple_px)
    rows, without = [], [()] + [(options.ablate,)] * bool(options.ablate)
    for prompt in options.prompts or prompts_about(options.thing):
        for removed in without:
            settings = GenerationSettings(without=removed)
            scene = pipeline(picture, "arc:0.1", prompt, settings=settings)
            last_s = float(scene.path.times_s[-1])
            shown = [render(scene, scene.path.cameras[0], share * last_s).rgb for share in TIMES]
            rows.append(torch.cat(shown, 1).clamp(0, 1))
    write_png(torch.cat(rows), options.out)


if __name__ == "__main__":
    main()
