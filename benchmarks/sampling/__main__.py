"""What sampling settings cost and give: solver error, images, and whether the text is followed.

Run ``python -m benchmarks.sampling --model small --out sampling.md``. Clips are worlds
of the training split that nobody trained on: defaults are chosen here, and held-out worlds stay
unseen.

    calls          evaluations of the network per generation
    error          RMS distance from what 64 steps make of the same noise, in standard deviations
                   of latents, or in units of motion
    error / still  squared error of told motion, over that of standing still
    PSNR           decoded video against the true one, or images of the scene along the path
    direction      cases in which the named object goes to the asked side; both counts as one each
    still          Gaussians that stand when nothing is asked to move
"""

import argparse
from pathlib import Path

import torch

from benchmarks.sampling.motion import motion_table
from benchmarks.sampling.scenes import kept_back, scene_table
from benchmarks.sampling.video import video_table
from diff4splat.flow.guidance import UNGUIDED, Guidance
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.io.atomic import write_text
from diff4splat.models.hub.model import load_model

SOLVERS = tuple(
    GenerationSettings(steps=steps, sampler=sampler, shift=shift, guidance=UNGUIDED)
    for sampler, shift in (("euler", 1.0), ("multistep2", 1.0), ("multistep2", 3.0))
    for steps in (2, 4, 8, 16)
)
MOTIONS = tuple(
    MotionSettings(steps=steps, shift=shift)
    for steps, shift in ((1, 16.0), (2, 16.0), (4, 16.0), (8, 16.0), (8, 1.0), (16, 16.0))
)
ASKED = tuple(
    MotionSettings(steps=steps, guidance=Guidance(weight=weight, low=0.2), threshold=above)
    for steps, weight, above in (
        (1, 1.0, 0.5),
        (1, 1.0, 0.3),
        (1, 2.0, 0.5),
        (4, 1.0, 0.5),
        (8, 1.0, 0.5),
    )
)


@torch.no_grad()
def main() -> None:
    """All tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--clips", type=int, default=16)
    parser.add_argument("--video", action="store_true", help="also the sampled video")
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    options = parser.parse_args()
    model, protocol = load_model(options.model), kept_back(options.clips)
    tables = []
    if model.config.motion_unet.used:
        tables.append(motion_table(model, protocol, MOTIONS))
    if options.video or not tables:
        tables.append(video_table(model, protocol, SOLVERS))
    asked = [GenerationSettings(motion=motion) for motion in ASKED]
    tables.append(scene_table(Diff4SplatPipeline(model), protocol, asked))
    write_text(options.out, "\n\n".join(tables) + "\n")


if __name__ == "__main__":
    main()
