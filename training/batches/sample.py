"""One clip to one sample: frames, size, units, targets.

Axes: ``f`` frames, ``h w`` pixels. Everything random comes from the generator of the sample's key.
"""

from dataclasses import dataclass, field, replace

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
    motion_known,
    moving_mask,
    pixel_motion,
)
from diff4splat.training.batches.normalise_scale import in_unit
from diff4splat.training.batches.requests.draw import draw_request
from diff4splat.training.batches.resize import fitted
from diff4splat.training.batches.targets import INPUT_VIEW, Targets, draw_targets, draw_tracks
from diff4splat.training.batches.temporal_crop import at_frame_rate, crop, repeat_keyframes
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.stage import SampleKey


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where a sample comes from."""

    key: SampleKey
    source: str
    settings: SourceSettings = field(default_factory=SourceSettings)


def make_sample(clip: Clip, settings: DataSettings, origin: Origin) -> ClipBatch:
    """A batch of one.

    Raises:
        InputError: the clip is too short, has too little depth, or another shape than asked for.
    """
    generator = origin.key.generator()
    clip, settings = _as_source(clip, settings, origin.settings)
    clip = fitted(_window(clip, settings, generator), settings.size_px)
    clip = augmented(clip, settings, generator)
    clip = in_unit(clip, settings)
    targets = draw_targets(
        clip.frames,
        len(clip.views[: settings.views]),
        settings,
        generator,
        is_static=clip.note.is_static,
    )
    if not (settings.supervise_motion or clip.note.is_static):
        targets = targets.at_first_frame()
    tracks = draw_tracks(clip, targets.frames, settings, generator)
    motion, caption = _motion_and_caption(clip, settings, generator)
    moving = moving_mask(motion)
    depths = [_depth(clip, number, origin) for number in range(len(clip.views))]
    view, shown = clip.views[INPUT_VIEW], slice(None, None, settings.input_stride)
    return ClipBatch(
        sample_index=torch.tensor([origin.key.sample]),
        source=(origin.source,),
        video=view.rgb[None, shown],
        cameras=stack_cameras([view.cameras[shown]]).to(torch.float32),
        depth=depths[INPUT_VIEW][None, shown][:, :: settings.keyframe_stride],
        target_rgb=_images([view.rgb for view in clip.views], targets)[None],
        target_depth=_images(depths, targets)[None],
        target_cameras=stack_cameras([_target_cameras(clip, targets)]).to(torch.float32),
        target_time=_fractions(clip, targets, generator)[None],
        track_cell=tracks.cell[None],
        track_offset=tracks.offset[None],
        track_valid=tracks.valid[None],
        field=extend_to_all_cells(motion, moving)[None],
        moving=moving[None],
        motion_known=torch.tensor([motion_known(clip, settings.input_stride)]),
        is_static=torch.tensor([clip.note.is_static]),
        captions=(caption,),
    )


def _motion_and_caption(
    clip: Clip, settings: DataSettings, generator: torch.Generator
) -> tuple[Float[Tensor, "3 t h w"], str]:
    """The clip's own, or those of another request for its first image."""
    motion = pixel_motion(clip, settings.input_stride)
    if not any(settings.request_shares):
        return motion, clip.note.caption
    request = draw_request(clip, motion, settings, generator)
    return (motion, clip.note.caption) if request is None else (request.motion, request.caption)


def _as_source(
    clip: Clip, settings: DataSettings, source: SourceSettings
) -> tuple[Clip, DataSettings]:
    """What the source gives of the clip: some of its views, its motion or not, its unit."""
    if source.views:
        clip = replace(clip, views=clip.views[: source.views])
    if source.motion_loss == "never":
        clip = replace(clip, tracks=None)
    return clip, replace(settings, unit=source.unit or settings.unit)


def _window(clip: Clip, settings: DataSettings, generator: torch.Generator) -> Clip:
    if not settings.keyframes_only:
        clip = at_frame_rate(clip, settings.fps, settings.clip_frames)
        return crop(clip, settings.clip_frames, generator)
    if clip.frames != settings.clip_frames:
        raise InputError(
            f"clip {clip.note.identifier}: expected {settings.clip_frames} keyframes, got "
            f"{clip.frames} frames; draw such clips or train with data.keyframes_only=false"
        )
    return repeat_keyframes(clip, settings.keyframe_spacing)


def _depth(clip: Clip, number: int, origin: Origin) -> Float[Tensor, "f h w"]:
    """Depth that may teach: 0 where the view has none, or the source's loss leaves it out."""
    depth, rule = clip.views[number].depth, origin.settings.depth_loss
    left_out = rule == "never" or (rule == "true" and clip.note.metric == "pseudo")
    if depth is None or left_out:
        return torch.zeros(clip.frames, *clip.size_px)
    return depth.float()


def _images(views: list[Tensor], targets: Targets) -> Tensor:
    """One kind of image at every target, with axes ``m p`` in front."""
    rows = [torch.stack([views[view][frame] for view, frame in row]) for row in targets.images()]
    return torch.stack(rows)


def _target_cameras(clip: Clip, targets: Targets) -> Camera:
    rows = [
        stack_cameras([clip.views[view].cameras[frame] for view, frame in row])
        for row in targets.images()
    ]
    return stack_cameras(rows)


def _fractions(clip: Clip, targets: Targets, generator: torch.Generator) -> Float[Tensor, " m"]:
    """Target times; any time shows a static clip, which teaches that time alone moves nothing."""
    if clip.note.is_static:
        return torch.rand(len(targets.frames), generator=generator)
    span_s = clip.times_s[-1] - clip.times_s[0]
    return ((clip.times_s[targets.frames] - clip.times_s[0]) / span_s.clamp_min(1e-9)).float()
