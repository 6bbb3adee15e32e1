"""Turns a reader's undecoded capture into a capture: checks sizes, scales intrinsics."""

from collections import defaultdict
from dataclasses import replace

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.data_prep.readers.common.capture_frames import CaptureFrames, require_size
from diff4splat.data_prep.readers.common.fisheye_lenses import LENS_NOTES, require_shared_optics
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry.camera import Camera


def assemble_capture(undecoded: UndecodedCapture, options: ReadOptions) -> Capture:
    """The capture of ``undecoded``; reads the header of every image.

    Raises:
        InputError: there are no images.
        ConfigError: the images are smaller than one block of the downscaling.
        FileFormatError: an image is missing, or of another size, shape or lens.
    """
    if not undecoded.shots:
        raise InputError(f"{undecoded.name}: expected images, got none; check the folder")
    shots = _with_scaled_intrinsics(every_nth_time(undecoded.shots, options.frame_step))
    _require_blocks(shots[0].lens.size_px, undecoded.shrink, undecoded.name)
    return Capture(
        name=undecoded.name,
        source=undecoded.source,
        cameras=_cameras(shots, undecoded.shrink),
        times_s=torch.tensor([shot.time_s for shot in shots], dtype=torch.float64),
        camera_index=torch.tensor([shot.camera for shot in shots]),
        held_out=torch.tensor([shot.held_out for shot in shots]),
        frames=CaptureFrames(shots, undecoded.background, undecoded.shrink),
        optics=require_shared_optics(shots),
        points=undecoded.points,
        background=undecoded.background,
        split_reason=undecoded.split_reason,
        notes=(*undecoded.notes, *_notes(shots, undecoded, options.frame_step)),
    )


def every_nth_time(shots: list[Shot], step: int) -> list[Shot]:
    """Every ``step``-th time of each camera, separately for training and test frames."""
    if step == 1:
        return shots
    times = defaultdict(set)
    for shot in shots:
        times[shot.camera, shot.held_out].add(shot.time_s)
    kept = {key: set(sorted(found)[::step]) for key, found in times.items()}
    return [shot for shot in shots if shot.time_s in kept[shot.camera, shot.held_out]]


def _with_scaled_intrinsics(shots: list[Shot]) -> list[Shot]:
    size_px = shots[0].image.size_px()
    for shot in shots:
        require_size(shot.image.where, shot.image.size_px(), size_px)
    return [replace(shot, lens=shot.lens.scaled_to(size_px, shot.image.where)) for shot in shots]


def _require_blocks(size_px: tuple[int, int], shrink: int, name: str) -> None:
    if min(size_px) < shrink:
        raise ConfigError(
            f"{name}: expected a downscale of at most {min(size_px)}, since images are "
            f"{size_px[1]} x {size_px[0]}, got {shrink}; choose a smaller one"
        )


def _cameras(shots: list[Shot], shrink: int) -> Camera:
    lenses = [shot.lens.downscaled(shrink) for shot in shots]
    return Camera(
        focal_px=torch.tensor([lens.focal_px for lens in lenses], dtype=torch.float64),
        center_px=torch.tensor([lens.center_px for lens in lenses], dtype=torch.float64),
        world_from_camera=torch.stack([shot.world_from_camera for shot in shots]).double(),
        size_px=lenses[0].size_px,
    )


def _notes(shots: list[Shot], undecoded: UndecodedCapture, step: int) -> tuple[str, ...]:
    first = shots[0]
    left_over = max(side % undecoded.shrink for side in first.lens.size_px)
    done = {
        "lens distortion was removed from the images; pixels without a source do not count": any(
            shot.lens.is_distorted for shot in shots
        ),
        LENS_NOTES.get(first.lens.model, ""): first.lens.keeps_projection,
        f"one time in {step} of each camera was taken": step > 1,
        f"up to {left_over} rows or columns were cut, so that blocks of {undecoded.shrink} pixels "
        "fill the image": left_over > 0,
        "pixels that are NaN do not count": first.image.is_float,
        "transparent pixels do not count, since no background was given": (
            undecoded.background is None and first.image.has_alpha()
        ),
    }
    return tuple(note for note, holds in done.items() if holds)
