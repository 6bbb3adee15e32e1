"""How different the futures are that different seeds give one picture.

Run ``python benchmarks/futures.py --model small --out futures.md``. Per held-out picture of
``text_v1`` a few seeds, with the clip's own caption and without any text, by the mean of what the
words allow (one step of the motion branch, the default) and by draws from it (eight):

    way        mean distance that the named object's surface goes until the last frame, in units of
               which the median depth of the picture is 4
    spread     standard deviation over seeds of its way to the right, mean over pictures
    pictures   mean PSNR between the last frames of two seeds, seen by the input view

Axes: ``h w`` pixels.
"""

import argparse
import itertools
import statistics
from dataclasses import replace
from pathlib import Path

import torch

from diff4splat.evaluation.measures.text import TextSample, text_sample
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.evaluation.protocols.sample import make_sample
from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.evaluation.systems.predictions import scene_flow
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.io.atomic import write_text
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

PROTOCOL = "text_v1"
EQUAL_DB = 100.0
"""Stands for infinitely many."""


def futures(subject: Generator, found: TextSample, prompt: str | None, seeds: int) -> list[Scene]:
    """One scene per seed."""
    return [subject.generate(found.sample, prompt, seed) for seed in range(seeds)]


def judged(found: TextSample, scenes: list[Scene]) -> tuple[float, float, float]:
    """Way, spread and PSNR between the futures of one picture."""
    camera = found.sample.input_view.cameras[0]
    last_s = float(found.sample.clip.times_s[-1])
    flows = [scene_flow(scene, camera, 0.0, (last_s,))[0][found.mask] for scene in scenes]
    rightward = [float(flow[:, 0].mean()) for flow in flows]
    way = statistics.fmean(float(flow.norm(dim=-1).mean()) for flow in flows)
    seen = [render(scene, camera.to(torch.float32), last_s).rgb.clamp(0, 1) for scene in scenes]
    pairs = itertools.combinations(seen, 2)
    alike = statistics.fmean(min(float(psnr(a, b)), EQUAL_DB) for a, b in pairs)
    return way, statistics.stdev(rightward), alike


def subject_of(pipeline: Diff4SplatPipeline, steps: int) -> Generator:
    """The pipeline with so many steps of its motion branch."""
    motion = replace(GenerationSettings().motion, steps=steps)
    return Generator(pipeline=pipeline, settings=GenerationSettings(motion=motion))


@torch.no_grad()
def main() -> None:
    """For every number of steps a row with captions and one without."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--items", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--steps", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    options = parser.parse_args()
    pipeline = Diff4SplatPipeline.from_pretrained(options.model)
    subjects = {steps: subject_of(pipeline, steps) for steps in options.steps}
    loaded = load_protocol(PROTOCOL)
    clips, protocol = open_clips(loaded), loaded.protocol
    rows: dict[tuple[str, int], list[tuple[float, float, float]]] = {}
    for item in range(options.items):
        case = make_sample(clips.clip(protocol.source.first + item), protocol, "text")
        found = text_sample(case)
        if found is None:
            continue
        prompts = (("own caption", case.clip.note.caption), ("no text", None))
        for (row, prompt), (steps, subject) in itertools.product(prompts, subjects.items()):
            scenes = futures(subject, found, prompt, options.seeds)
            rows.setdefault((row, steps), []).append(judged(found, scenes))
    lines = ["| | steps | way | spread | pictures [dB] |", "|---|---:|---:|---:|---:|"]
    for (row, steps), values in rows.items():
        way, spread, alike = map(statistics.fmean, zip(*values, strict=True))
        lines.append(f"| {row} | {steps} | {way:.3f} | {spread:.3f} | {alike:.1f} |")
    print("\n".join(lines))
    write_text(options.out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
