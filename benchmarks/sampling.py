"""What sampling settings cost and give: solver error, pictures, and whether the text is followed.

Run ``python benchmarks/sampling.py --model small --out sampling.md``. Clips are worlds of the
training split that nobody trained on: defaults are chosen here, and held-out worlds stay unseen.

    calls      evaluations of the video model per generation
    error      RMS distance of the latents from those of REFERENCE with the same noise, in
               standard deviations of the latents
    PSNR       decoded video against the true one
    direction  cases in which the named object goes to the asked side; both counts as one case each
    still      Gaussians that stand when nothing is asked to move

Axes: ``b c t h w`` latents.
"""

import argparse
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.configs.small import small_recipe
from diff4splat.flow.guidance import Guidance
from diff4splat.io.atomic import write_text
from diff4splat.metrics.image import psnr
from diff4splat.models.latent_sampling import Conditions, sample_video
from diff4splat.models.pipeline import Diff4SplatPipeline
from diff4splat.models.pretrained import Model, load_model, with_text_encoder
from diff4splat.models.settings import GenerationSettings
from diff4splat.training.batches.scale import normalized
from diff4splat.training.batches.window import from_first_camera
from diff4splat.training.evaluation.captions import grammar_caption
from diff4splat.training.evaluation.case import make_case
from diff4splat.training.evaluation.opening import open_clips
from diff4splat.training.evaluation.protocol import Protocol
from diff4splat.training.evaluation.protocol_json import LoadedProtocol, load_protocol
from diff4splat.training.evaluation.records import Score
from diff4splat.training.evaluation.subjects import Generator
from diff4splat.training.evaluation.text_measures import text_entries
from diff4splat.training.latents.encode import encode_clip
from diff4splat.training.stages.model_stage import camera_rays, shown_video

SEED = 4711
"""Of the worlds: no training series has it."""
REFERENCE = GenerationSettings(steps=64, guidance=Guidance(weight=1.0))
UNGUIDED = Guidance(weight=1.0)
SOLVERS = tuple(
    GenerationSettings(steps=steps, sampler=sampler, shift=shift, guidance=UNGUIDED)
    for sampler, shift in (("euler", 1.0), ("multistep2", 1.0), ("multistep2", 3.0))
    for steps in (2, 4, 8, 16)
)
GUIDANCES = tuple(
    GenerationSettings(steps=8, guidance=guidance)
    for guidance in (
        UNGUIDED,
        Guidance(weight=2.0, low=0.2, high=1.0),
        Guidance(weight=5.0, low=0.2, high=1.0),
        Guidance(weight=5.0, low=0.2, high=0.9),
        Guidance(weight=8.0, low=0.2, high=1.0),
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """One clip, encoded, with its true video."""

    conditions: Conditions
    truth: Float[Tensor, "b f h w 3"]


def kept_back(count: int) -> Protocol:
    """Moving worlds of the training split under a seed of their own."""
    shipped = load_protocol("text_v1").protocol
    source = replace(shipped.source, split="training", seed=SEED, count=count)
    return replace(shipped, name="sampling", source=source, text_cases=count)


def prepared(model: Model, protocol: Protocol) -> list[Prepared]:
    """Every clip of the protocol as the video model sees it."""
    clips = open_clips(LoadedProtocol(protocol=protocol, folder=Path()))
    data = small_recipe().stage("generator").data
    found = []
    for index in range(protocol.source.count):
        clip = normalized(from_first_camera(clips.clip(index)))
        pack = encode_clip(model, clip, data)
        conditions = Conditions(
            image_latent=pack.latent[:, :, :1],
            plucker=camera_rays(pack.cameras),
            text=model.networks.text_encoder.encode_prompt(pack.captions[0]),
            draft=pack.draft,
        )
        video = clip.views[0].rgb[: data.clip_frames : data.input_stride]
        found.append(Prepared(conditions=conditions, truth=video[None].float() / 255))
    return found


def solver_row(
    model: Model, clips: Sequence[Prepared], settings: GenerationSettings, best: list[Tensor]
) -> str:
    """Calls, error and PSNR of one setting."""
    errors, quality, calls = [], [], 0
    for index, (clip, reference) in enumerate(zip(clips, best, strict=True)):
        video = sample_video(model.networks.dit, clip.conditions, settings, seed=index)
        later = (video.latent - reference)[:, :, 1:]
        errors.append(float(later.square().mean().sqrt()))
        shown = shown_video(model.networks.vae.decode(video.latent)).clamp(0, 1)
        quality.append(float(psnr(shown[:, 1:], clip.truth[:, 1:]).mean()))
        calls = video.calls.conditional + video.calls.unconditional
    error, mean_psnr = statistics.fmean(errors), statistics.fmean(quality)
    return (
        f"| {settings.sampler} | {settings.steps} | {settings.shift:g} | {calls} | "
        f"{error:.3f} | {mean_psnr:.2f} |"
    )


def text_row(pipeline: Diff4SplatPipeline, protocol: Protocol, settings: GenerationSettings) -> str:
    """How well the text is followed under one setting."""
    clips = open_clips(LoadedProtocol(protocol=protocol, folder=Path()))
    subject = Generator(pipeline=pipeline, settings=settings)
    scores: dict[str, list[float]] = {}
    for index in range(protocol.source.count):
        case = make_case(clips.clip(index), protocol, "text")
        for entry in text_entries("", case, subject, grammar_caption, protocol):
            if isinstance(entry, Score):
                scores.setdefault(entry.key, []).append(entry.value)
    means = {key: statistics.fmean(values) for key, values in scores.items()}
    return (
        f"| {settings.guidance} | {means['text_right']:.2f} | {means['text_both']:.2f} | "
        f"{means['text_still']:.3f} |"
    )


@torch.no_grad()
def main() -> None:
    """Both tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--clips", type=int, default=16)
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    options = parser.parse_args()
    model, protocol = with_text_encoder(load_model(options.model)), kept_back(options.clips)
    clips = prepared(model, protocol)
    best = [
        sample_video(model.networks.dit, clip.conditions, REFERENCE, seed=index).latent
        for index, clip in enumerate(clips)
    ]
    lines = [
        "| sampler | steps | shift | calls | error | PSNR [dB] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for settings in SOLVERS:
        lines.append(solver_row(model, clips, settings, best))
        print(lines[-1], flush=True)
    lines += ["", "| guidance | direction | both | still |", "|---|---:|---:|---:|"]
    pipeline = Diff4SplatPipeline(model)
    for settings in GUIDANCES:
        lines.append(text_row(pipeline, protocol, settings))
        print(lines[-1], flush=True)
    write_text(options.out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
