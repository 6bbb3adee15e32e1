"""What guidance does to whole scenes: is the text followed, are images along the path right?"""

import statistics
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from diff4splat.evaluation.measures.captions import grammar_caption
from diff4splat.evaluation.measures.text import text_entries
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol, load_protocol
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample
from diff4splat.evaluation.records import Score
from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render

SEED = 4711
"""Of the worlds: no training series has it."""


def kept_back(count: int) -> Protocol:
    """Worlds of the training split under a seed of their own, in each of which something moves."""
    shipped = load_protocol("text_v1").protocol
    source = replace(shipped.source, split="training", seed=SEED, count=count)
    along = load_protocol("path_v1").protocol.generation
    return replace(shipped, name="sampling", source=source, text_cases=count, generation=along)


def scene_table(
    pipeline: Diff4SplatPipeline, protocol: Protocol, settings: Sequence[GenerationSettings]
) -> str:
    """A row for each of ``settings``."""
    lines = [
        "| steps | guidance | moves above | direction | both | still | PSNR along the path [dB] |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for one in settings:
        lines.append(_row(Generator(pipeline=pipeline, settings=one), protocol))
        print(lines[-1], flush=True)
    return "\n".join(lines)


def _row(subject: Generator, protocol: Protocol) -> str:
    clips = open_clips(LoadedProtocol(protocol=protocol, folder=Path()))
    scores: dict[str, list[float]] = {}
    pictures = []
    for index in range(protocol.source.count):
        clip = clips.clip(index)
        case = make_sample(clip, protocol, "text")
        for entry in text_entries("", case, subject, grammar_caption, protocol):
            if isinstance(entry, Score):
                scores.setdefault(entry.key, []).append(entry.value)
        pictures.append(_along_the_path(subject, make_sample(clip, protocol, "generation")))
    right, both, still = (
        statistics.fmean(scores[key]) for key in ("text_right", "text_both", "text_still")
    )
    quality = statistics.fmean(pictures)
    asked = subject.settings.motion
    how = f"{asked.steps} | {asked.guidance.weight:g} | {asked.threshold:g}"
    return f"| {how} | {right:.2f} | {both:.2f} | {still:.3f} | {quality:.2f} |"


def _along_the_path(subject: Generator, case: EvalSample) -> float:
    """Mean PSNR over the evaluated images, with the clip's own caption."""
    scene = subject.predict(case, seed=0)
    found = []
    for pair in case.targets.pairs:
        camera = case.camera(pair).to(scene.gaussians.means.dtype)
        seen = render(scene, camera, case.time_s(pair[1])).rgb.clamp(0, 1)
        found.append(float(psnr(seen, case.true_rgb(pair))))
    return statistics.fmean(found)
