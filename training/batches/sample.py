"""One clip to one sample: frames, size, units, targets.

Axes: ``f`` frames, ``h w`` pixels. Everything random comes from the generator of the sample's key.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.training.batches.augment import augmented
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.motion_targets import (
    extend_to_all_cells,
    moving_mask,
    pixel_motion,
)
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.resize import resized
from diff4splat.training.batches.targets import INPUT_VIEW, Targets, draw_targets, draw_tracks
from diff4splat.training.batches.temporal_crop import crop, repeat_keyframes
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.stage import SampleKey


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where a sample comes from."""

    key: SampleKey
    source: str


def make_sample(clip: Clip, settings: DataSettings, origin: Origin) -> ClipBatch:
    """A batch of one.

    Raises:
        InputError: the clip is too short, has too little depth, or another shape than asked for.
    """
    generator = origin.key.generator()
    _require_views(clip, settings.views)
    clip = resized(_window(clip, settings, generator), settings.size_px)
    clip = augmented(clip, settings, generator)
    clip = normalized(clip, settings.min_valid_depth)
    targets = draw_targets(clip.frames, len(clip.views[: settings.views]), settings, generator)
    if not (settings.supervise_motion or clip.note.is_static):
        targets = replace(targets, frames=torch.zeros_like(targets.frames))
    tracks = draw_tracks(clip, targets.frames, settings, generator)
    motion = pixel_motion(clip, settings.input_stride)
    moving = moving_mask(motion)
    view, shown = clip.views[INPUT_VIEW], slice(None, None, settings.input_stride)
    return ClipBatch(
        sample_index=torch.tensor([origin.key.sample]),
        source=(origin.source,),
        video=view.rgb[None, shown],
        cameras=stack_cameras([view.cameras[shown]]).to(torch.float32),
        depth=view.depth[None, shown][:, :: settings.keyframe_stride].float(),
        target_rgb=_images(clip, targets, "rgb")[None],
        target_depth=_images(clip, targets, "depth").float()[None],
        target_cameras=stack_cameras([_target_cameras(clip, targets)]).to(torch.float32),
        target_time=_fractions(clip, targets, generator)[None],
        track_cell=tracks.cell[None],
        track_offset=tracks.offset[None],
        track_valid=tracks.valid[None],
        field=extend_to_all_cells(motion, moving)[None],
        moving=moving[None],
        is_static=torch.tensor([clip.note.is_static]),
        captions=(clip.note.caption,),
    )


def _window(clip: Clip, settings: DataSettings, generator: torch.Generator) -> Clip:
    if not settings.keyframes_only:
        return crop(clip, settings.clip_frames, generator)
    if clip.frames != settings.clip_frames:
        raise InputError(
            f"clip {clip.note.identifier}: expected {settings.clip_frames} keyframes, got "
            f"{clip.frames} frames; draw such clips or train with data.keyframes_only=false"
        )
    return repeat_keyframes(clip, settings.keyframe_spacing)


def _require_views(clip: Clip, views: int) -> None:
    """Clips of one view have samples of another shape than clips of several."""
    if len(clip.views) == 1 < views:
        raise InputError(
            f"clip {clip.note.identifier}: expected at least 2 views, got 1; "
            "leave the clip out or train with data.views=1"
        )


def _images(clip: Clip, targets: Targets, name: str) -> Tensor:
    """One kind of image at every target, with axes ``m p`` in front."""
    rows = [
        torch.stack([getattr(clip.views[view], name)[frame] for view in views])
        for frame, views in targets.pairs()
    ]
    return torch.stack(rows)


def _target_cameras(clip: Clip, targets: Targets) -> Camera:
    rows = [
        stack_cameras([clip.views[view].cameras[frame] for view in views])
        for frame, views in targets.pairs()
    ]
    return stack_cameras(rows)


def _fractions(clip: Clip, targets: Targets, generator: torch.Generator) -> Float[Tensor, " m"]:
    """Target times; any time shows a static clip, which teaches that time alone moves nothing."""
    if clip.note.is_static:
        return torch.rand(len(targets.frames), generator=generator)
    span_s = clip.times_s[-1] - clip.times_s[0]
    return ((clip.times_s[targets.frames] - clip.times_s[0]) / span_s.clamp_min(1e-9)).float()
