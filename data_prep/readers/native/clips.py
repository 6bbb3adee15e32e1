"""One clip of a clip folder of this library; every view is a camera, with depth and flow.

Tracks are not read, since a capture has none. By default the last view is held out, or every eighth
time of a clip with one view.
"""

from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.data.manifest import MANIFEST
from diff4splat.data_prep.readers.common.test_split import (
    TEST_TIME_STEP,
    requested_reason,
    require_cameras,
)
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.data_prep.readers.native.clip_frames import ClipFrames
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.geometry.camera import Camera, join_cameras
from diff4splat.paths.messages import unknown_name

EXPECTED_FILES = "manifest.json of a folder of clips (diff4splat-clips)"

_LISTED = 5
"""Names of clips in a message."""


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    try:
        return read_object(folder / MANIFEST).get("format") == "diff4splat-clips"
    except FileFormatError:
        return False


def read(location: CaptureLocation, options: ReadOptions) -> Capture:
    """The capture of one clip; its images stay in memory as bytes.

    Raises:
        ConfigError: no such clip, several and none is named, or no such camera.
        FileFormatError: the shard is missing or damaged.
    """
    clips = ClipFolder(location.folder)
    position = _position(clips, options.clip, location.name)
    taken = range(0, clips.entries[position].frames, options.frame_step)
    # Flow refers to the next frame, which a frame step skips.
    with_flow = options.frame_step == 1
    part = ClipPart(frames=tuple(taken), flow=with_flow, instances=False, tracks=False)
    clip = clips.clip(position, part)
    held_out, reason = _held_out(clip, options.hold_out)
    frames = ClipFrames(clip.views, options.downscale)
    return Capture(
        name=clip.note.identifier,
        source="diff4splat clip",
        cameras=_coarser(clip, options.downscale),
        times_s=clip.times_s.double().repeat(len(clip.views)),
        camera_index=torch.arange(len(clip.views)).repeat_interleave(clip.frames),
        held_out=held_out,
        frames=frames,
        background=options.background,
        split_reason=reason,
        license=clip.note.license,
        notes=_notes(clip, options.frame_step),
    )


def _position(clips: ClipFolder, wanted: str | None, name: str) -> int:
    if wanted is None and len(clips) == 1:
        return 0
    if wanted is None:
        raise ConfigError(
            f"{name}: expected the name of one clip, since the folder has {len(clips)}; choose one "
            f"({', '.join(clips.identifiers[:_LISTED])}{', ...' * (len(clips) > _LISTED)})"
        )
    if wanted not in clips.identifiers:
        listed = clips.identifiers[:_LISTED]
        raise ConfigError(unknown_name("clip", wanted, listed, clips.identifiers))
    return clips.identifiers.index(wanted)


def _held_out(clip: Clip, wanted: tuple[int, ...] | None) -> tuple[Bool[Tensor, " f"], str]:
    views, frames = len(clip.views), clip.frames
    camera = torch.arange(views).repeat_interleave(frames)
    if wanted is not None:
        require_cameras(wanted, views, clip.note.identifier)
        return torch.isin(camera, torch.tensor(wanted, dtype=torch.int64)), requested_reason(wanted)
    if views > 1:
        return camera == views - 1, "the last view held out, by default"
    every = torch.arange(frames) % TEST_TIME_STEP == 0
    reason = f"every {TEST_TIME_STEP}th time held out, by default: the clip has one view"
    return every & (frames > 1), reason


def _coarser(clip: Clip, factor: int) -> Camera:
    cameras = join_cameras([view.cameras.to(torch.float64) for view in clip.views])
    height, width = cameras.size_px
    if min(height, width) < factor:
        raise ConfigError(
            f"{clip.note.identifier}: expected a downscale of at most {min(height, width)}, got "
            f"{factor}; choose a smaller one"
        )
    return replace(
        cameras,
        focal_px=cameras.focal_px / factor,
        center_px=cameras.center_px / factor,
        size_px=(height // factor, width // factor),
    )


def _notes(clip: Clip, step: int) -> tuple[str, ...]:
    done = {
        f"one time in {step} of each camera was taken, without flow": step > 1,
        "lengths are metres": clip.note.metric == "exact",
    }
    return tuple(note for note, holds in done.items() if holds)
