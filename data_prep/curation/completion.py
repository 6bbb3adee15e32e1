"""What curation can add to a clip: a mask of what moves, tracks out of true flow.

A clip that has a mask or exact tracks keeps them as they are; estimated tracks lose those that are
not reliable. An estimate that decides nothing (too much moves) adds nothing. Axes: ``t h w``.
"""

from dataclasses import replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool

from diff4splat.data.clip import Clip
from diff4splat.data_prep.curation.clip_record import record_of
from diff4splat.data_prep.curation.stages.dynamic_mask import score_dynamic_mask
from diff4splat.data_prep.curation.stages.image_motion import score_image_motion
from diff4splat.data_prep.curation.tracks.filtering import reliable_tracks, without_tracks
from diff4splat.data_prep.curation.tracks.flow_chains import with_chained_tracks
from diff4splat.data_prep.curation.working_clip import working_clip
from diff4splat.errors import InputError


def completed(clip: Clip) -> Clip:
    """The clip with a mask and tracks where they can be had, of its input view."""
    return _with_tracks(_with_mask(clip))


def _with_mask(clip: Clip) -> Clip:
    view = clip.views[0]
    if clip.note.is_static or view.moving is not None or view.instances is not None:
        return clip
    working = score_image_motion(working_clip(clip, record_of(clip, "", "")))
    moving = score_dynamic_mask(working).moving
    if moving is None:
        return clip
    mask = torch.from_numpy(_enlarged(moving, clip.size_px))
    return replace(clip, views=(replace(view, moving=mask), *clip.views[1:]))


def _with_tracks(clip: Clip) -> Clip:
    view = clip.views[0]
    if clip.tracks is None and view.flow is not None and view.depth is not None:
        try:
            clip = with_chained_tracks(clip)
        except InputError:
            return clip  # no chain is long enough, as in fast scenes
    if clip.tracks is None or clip.note.track_source == "exact":
        return clip
    reliable = reliable_tracks(clip)
    return without_tracks(clip, reliable) if bool(reliable.any()) else _trackless(clip)


def _trackless(clip: Clip) -> Clip:
    """The clip without any track."""
    views = tuple(replace(view, track_uv=None, track_visible=None) for view in clip.views)
    return replace(clip, tracks=None, views=views)


def _enlarged(
    masks: Bool[np.ndarray, "t h w"], size_px: tuple[int, int]
) -> Bool[np.ndarray, "t h2 w2"]:
    size = size_px[::-1]
    frames = [
        cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT)
        for mask in masks
    ]
    return np.stack(frames).astype(bool)
