"""Clips to latents and drafts, once and for all; each clip also in a mirror.

    clip ─ input video ─┬─ vae ──────────────────────────── latent
                        └─ first picture ─ draft ─ vae ──── draft

Axes: ``f`` video frames, ``c t h w`` latents.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.mirror import mirrored_caption
from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.errors import InputError
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.render_condition import render_condition_latent
from diff4splat.geometry.camera import stack_cameras
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.motion_unet.motion_field import pack_motion
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.augment import mirrored
from diff4splat.training.batches.motion_truth import motion_truth
from diff4splat.training.batches.resize import resized
from diff4splat.training.batches.scale import normalized
from diff4splat.training.batches.window import from_first_camera
from diff4splat.training.latents.stored import LatentPack, has_pack, join_packs, write_pack
from diff4splat.training.recipe import DataSettings

PACK = 128
"""Clips per file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodingJob:
    """What is encoded, by which model, into which folder."""

    model: Model
    data: DataSettings
    """Frames, stride and size of the videos."""
    clips: Path
    folder: Path
    mirror: bool = True
    """Each clip also with left and right exchanged, in pictures and in words."""


@torch.no_grad()
def encode_clips(job: EncodingJob, phases: Phases) -> int:
    """Write every clip that is long enough; returns how many versions were written.

    Packs that are there already are left as they are, so that a run can be repeated after a stop.

    Raises:
        InputError, FileFormatError: the clips cannot be read.
        OutputError: the folder cannot be written.
    """
    clips, count = ClipFolder(job.clips), 0
    starts = range(0, len(clips), PACK)
    with phases.phase("encode clips", len(clips)) as advance:
        for number, start in enumerate(starts):
            positions = range(start, min(start + PACK, len(clips)))
            versions: list[LatentPack] = []
            for position in positions:
                if not has_pack(job.folder, number):
                    versions += _versions(job, clips, position)
                advance()
            if versions:
                pack = replace(join_packs(versions), versions=2 if job.mirror else 1)
                write_pack(pack, job.folder, number)
            count += len(versions)
    return count


def _versions(job: EncodingJob, clips: ClipFolder, position: int) -> Iterator[LatentPack]:
    """The clip, and perhaps its mirror image; nothing if it cannot be used."""
    part = ClipPart(views=(0,), flow=False)
    try:
        clip = _input_clip(clips.clip(position, part), job.data)
    except InputError:
        return
    yield encode_clip(job.model, clip, job.data)
    if job.mirror:
        note = replace(clip.note, caption=mirrored_caption(clip.note.caption))
        yield encode_clip(job.model, replace(mirrored(clip), note=note), job.data)


def _input_clip(clip: Clip, data: DataSettings) -> Clip:
    """Size, units and frames as samples have them."""
    if clip.frames < data.clip_frames:
        raise InputError(
            f"clip {clip.note.identifier}: expected at least {data.clip_frames} frames, got "
            f"{clip.frames}; leave the clip out"
        )
    clip = from_first_camera(resized(clip, data.size_px))
    return normalized(clip, data.least_depth_share)


def encode_clip(model: Model, clip: Clip, data: DataSettings) -> LatentPack:
    """A clip in model units whose first camera is the identity, as a pack of one."""
    view, frames = clip.views[0], slice(None, data.clip_frames, data.input_stride)
    rgb, cameras = unit_rgb(view.rgb[frames]), view.cameras[frames].to(torch.float32)
    latent = model.networks.vae.encode(rgb.movedim(-1, 0)[None] * 2 - 1).mean
    picture = InputImage(rgb=rgb[0], camera=cameras[0], focal_source="clip")
    return LatentPack(
        latent=latent,
        draft=render_condition_latent(model, picture, cameras) if model.config.dit.draft else None,
        motion=true_motion(model, clip, data),
        cameras=stack_cameras([cameras]),
        is_static=torch.tensor([clip.note.is_static]),
        captions=(clip.note.caption,),
        model=model.weights_sha256,
    )


def true_motion(model: Model, clip: Clip, data: DataSettings) -> Float[Tensor, "1 m t h w"]:
    """For a model that makes one; otherwise without channels."""
    cells = motion_truth(clip, data.input_stride)[None]
    packed = pack_motion(cells, model.config.vae.space_stride)
    return packed[:, : model.config.motion_channels]
