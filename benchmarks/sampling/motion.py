"""Solver error of told motion, and how near it is to the true one, wherever anything moves.

Axes: ``c t hc wc`` = 3 numbers per latent frame and cell of 4 pixels.
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol
from diff4splat.evaluation.systems.evaluated_system import input_image
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.sampling import MotionRequest, sample_motion
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import Model
from diff4splat.training.batches.motion_targets import (
    extend_to_all_cells,
    moving_mask,
    pixel_motion,
)
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.temporal_crop import from_first_camera

REFERENCE = MotionSettings(steps=64)
INPUT_STRIDE = 2
"""Clip frames per frame of the video."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """One clip: what the branch is given, and the truth."""

    picture: InputImage
    text: Float[Tensor, "1 s d"]
    truth: Float[Tensor, "3 t hc wc"]

    def sampled(self, model: Model, settings: MotionSettings, seed: int) -> tuple[Tensor, int]:
        """Motion, and the network calls that it took."""
        asked = GenerationSettings(motion=settings)
        wish = MotionRequest(text=self.text, seed=seed, settings=asked)
        frames = self.truth.shape[1]
        made = sample_motion(model.networks.motion_unet, self.picture, frames, wish)
        return made.field, made.calls.conditional + made.calls.unconditional


def prepared(model: Model, protocol: Protocol) -> list[Told]:
    """Every clip of the protocol as the motion branch sees it."""
    clips = open_clips(LoadedProtocol(protocol=protocol, folder=Path()))
    found = []
    for index in range(protocol.source.count):
        clip = normalized(from_first_camera(clips.clip(index)))
        view, motion = clip.views[0], pixel_motion(clip, INPUT_STRIDE)
        found.append(
            Told(
                picture=input_image(unit_rgb(view.rgb[0]), view.cameras[0]),
                text=model.networks.text_encoder.encode_prompt(clip.note.caption),
                truth=extend_to_all_cells(motion, moving_mask(motion)),
            )
        )
    return found


def motion_table(model: Model, protocol: Protocol, settings: Sequence[MotionSettings]) -> str:
    """A row for each of ``settings``."""
    clips = prepared(model, protocol)
    best = [clip.sampled(model, REFERENCE, index)[0] for index, clip in enumerate(clips)]
    lines = [
        "| steps | shift | calls | error | error / still |",
        "|---:|---:|---:|---:|---:|",
    ]
    for one in settings:
        lines.append(_row(model, clips, one, best))
        print(lines[-1], flush=True)
    return "\n".join(lines)


def _row(
    model: Model, clips: Sequence[Told], settings: MotionSettings, best: Sequence[Tensor]
) -> str:
    errors, wrong, still, calls = [], 0.0, 0.0, 0
    for index, (clip, reference) in enumerate(zip(clips, best, strict=True)):
        made, calls = clip.sampled(model, settings, index)
        errors.append(float((made - reference)[:, 1:].square().mean().sqrt()))
        wrong += float((made - clip.truth).square().sum())
        still += float(clip.truth.square().sum())
    return (
        f"| {settings.steps} | {settings.shift:g} | {calls} | "
        f"{statistics.fmean(errors):.3f} | {wrong / still:.3f} |"
    )
