"""Solver error of video latents, and how near the decoded video is to the true one.

Axes: ``b c t h w`` latents, ``f h w`` images.
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.configs.small import small_recipe
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol
from diff4splat.flow.guidance import Guidance
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_sampling import Conditions, sample_video
from diff4splat.metrics.image import psnr
from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.temporal_crop import from_first_camera
from diff4splat.training.latents.encode import encode_clip
from diff4splat.training.latents.video_latents import camera_rays, image_video

REFERENCE = GenerationSettings(steps=64, guidance=Guidance(weight=1.0))
UNGUIDED = Guidance(weight=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """One clip, encoded, with its true video."""

    conditions: Conditions
    truth: Float[Tensor, "b f h w 3"]


def prepared(model: Model, protocol: Protocol) -> list[Prepared]:
    """Every clip of the protocol as the video model sees it."""
    clips = open_clips(LoadedProtocol(protocol=protocol, folder=Path()))
    data = small_recipe().stage("video_diffusion").data
    found = []
    for index in range(protocol.source.count):
        clip = normalized(from_first_camera(clips.clip(index)))
        pack = encode_clip(model, clip, data)
        conditions = Conditions(
            image_latent=pack.latent[:, :, :1],
            plucker=camera_rays(pack.cameras),
            text=model.networks.text_encoder.encode_prompt(pack.captions[0]),
            render=RenderCondition(latent=pack.render_latent, validity=pack.validity),
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
        shown = image_video(model.networks.vae.decode(video.latent)).clamp(0, 1)
        quality.append(float(psnr(shown[:, 1:], clip.truth[:, 1:]).mean()))
        calls = video.calls.conditional + video.calls.unconditional
    error, mean_psnr = statistics.fmean(errors), statistics.fmean(quality)
    return (
        f"| {settings.sampler} | {settings.steps} | {settings.shift:g} | {calls} | "
        f"{error:.3f} | {mean_psnr:.2f} |"
    )


def video_table(model: Model, protocol: Protocol, settings: Sequence[GenerationSettings]) -> str:
    """A row for each of ``settings``."""
    clips = prepared(model, protocol)
    best = [
        sample_video(model.networks.dit, clip.conditions, REFERENCE, seed=index).latent
        for index, clip in enumerate(clips)
    ]
    lines = [
        "| sampler | steps | shift | calls | error | PSNR [dB] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for one in settings:
        lines.append(solver_row(model, clips, one, best))
        print(lines[-1], flush=True)
    return "\n".join(lines)
