"""Clips to latents and render conditions, stored for training; each clip also mirrored.

    clip ─ input video ─┬─ vae ──────────────────────────── latent
                        └─ first image ─ render ─ vae ───── render condition

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
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import Model
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.augment import mirrored
from diff4splat.training.batches.motion_targets import (
    extend_to_all_cells,
    motion_known,
    moving_mask,
    pixel_motion,
)
from diff4splat.training.batches.normalise_scale import in_unit
from diff4splat.training.batches.resize import fitted
from diff4splat.training.batches.temporal_crop import from_first_camera
from diff4splat.training.latents.latent_shards import LatentPack, has_pack, join_packs, write_pack
from diff4splat.training.latents.video_latents import FirstFrame, render_condition
from diff4splat.training.recipe.data import DataSettings

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
    """Each clip also with left and right exchanged, in images and in words."""


@torch.no_grad()
def encode_clips(job: EncodingJob, phases: Phases) -> int:
    """Write every clip that is long enough; returns how many versions were written.

    Packs that are there already are left as they are, so that a run can be repeated after a stop.

    Raises:
        InputError, FileFormatError: the clips cannot be read.
        OutputError: the folder cannot be written.
    """
    clips, count = ClipFolder(job.clips), 0
    versions_each, weights = 2 if job.mirror else 1, job.model.weights_sha256()
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
                pack = replace(join_packs(versions), versions=versions_each, model=weights)
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
    clip = from_first_camera(fitted(clip, data.size_px))
    return in_unit(clip, data)


def encode_clip(model: Model, clip: Clip, data: DataSettings) -> LatentPack:
    """A clip in model units whose first camera is the identity, as a pack of one.

    The pack does not name the model: digesting its weights for every clip would be slow.
    """
    view, frames = clip.views[0], slice(None, data.clip_frames, data.input_stride)
    rgb, cameras = unit_rgb(view.rgb[frames]), view.cameras[frames].to(torch.float32)
    latent = model.networks.vae.encode(rgb.movedim(-1, 0)[None] * 2 - 1).mean
    condition = render_condition(model, _first_frame(clip, data, rgb[0], cameras))
    return LatentPack(
        latent=latent,
        render_latent=None if condition is None else condition.latent,
        validity=None if condition is None else condition.validity.bool(),
        cameras=stack_cameras([cameras]),
        is_static=torch.tensor([clip.note.is_static]),
        captions=(clip.note.caption,),
    )


def _first_frame(
    clip: Clip, data: DataSettings, rgb: Float[Tensor, "h w 3"], cameras: Camera
) -> FirstFrame:
    """The first input frame with its true motion."""
    motion = pixel_motion(clip, data.input_stride)
    moving = moving_mask(motion)
    return FirstFrame(
        rgb=rgb,
        field=extend_to_all_cells(motion, moving),
        moving=moving,
        cameras=cameras,
        motion_known=motion_known(clip, data.input_stride),
    )
