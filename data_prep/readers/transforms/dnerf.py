"""D-NeRF: ``transforms_train.json``, ``transforms_val.json`` and ``transforms_test.json``.

Poses have OpenGL camera axes; ``camera_angle_x`` is the horizontal field of view in radians;
``time`` runs from 0 to 1 and is kept; the background is white (Pumarola et al., CVPR 2021).
``hold_out`` counts the files: 0 is train, 1 is val, 2 is test.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from diff4splat.data_prep.readers.common.camera_ids import assign_camera_ids
from diff4splat.data_prep.readers.common.test_split import hold_out_times, requested_reason
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.transforms.frame_records import (
    load_frames,
    record_image,
    record_poses,
    record_time_s,
)
from diff4splat.data_prep.readers.transforms.lenses import record_intrinsics
from diff4splat.errors import ConfigError

EXPECTED_FILES = "transforms_train.json (and transforms_test.json, transforms_val.json)"
WHITE = (1.0, 1.0, 1.0)

_SPLITS = ("train", "val", "test")
_NO_TIME = "write the time of every image, from 0 to 1, into the file"
_LEGO = (
    "the test images of D-NeRF's lego do not show what its training images show; published "
    "numbers are of val (hold_out 1) or of test: do not compare them"
)


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    return _file(folder, "train").is_file()


def read(location: CaptureLocation, options: ReadOptions) -> UndecodedCapture:
    """Read the capture.

    Raises:
        ConfigError: a file that is not there is to be held out, or train is.
        FileFormatError: naming the file and frame.
    """
    held = _held_splits(location, options)
    shots = _shots_of(location, "train", 0)
    for split in held:
        first = 1 + max(shot.camera for shot in shots)
        shots += [replace(shot, held_out=True) for shot in _shots_of(location, split, first)]
    reason = _reason(held, options)
    if not held and options.hold_out is None:
        shots = hold_out_times(shots)
    background = options.background
    if background is None and shots[0].image.has_alpha():
        background = WHITE
    return UndecodedCapture(
        name=location.name,
        source="D-NeRF",
        shots=shots,
        split_reason=reason,
        shrink=options.downscale,
        background=background,
        notes=_notes(location, held),
    )


def _held_splits(location: CaptureLocation, options: ReadOptions) -> Sequence[str]:
    there, name = _there(location), location.name
    if options.hold_out is None:
        return there[:1]
    if not set(options.hold_out) <= {1, 2}:
        raise ConfigError(
            f"{name}: hold_out: expected 1 (val) or 2 (test), got {list(options.hold_out)}; "
            "in D-NeRF it counts the files"
        )
    wanted = [_SPLITS[number] for number in sorted(set(options.hold_out))]
    for split in wanted:
        if split not in there:
            raise ConfigError(
                f"{name}: hold_out: expected {_file(location.folder, split).name}, got no such "
                "file; hold out another"
            )
    return wanted


def _shots_of(location: CaptureLocation, split: str, first_camera: int) -> list[Shot]:
    file = _file(location.folder, split)
    _, frames = load_frames(file)
    poses, times_s = (
        record_poses(frames, file),
        [record_time_s(frame, _NO_TIME) for frame in frames],
    )
    images = [record_image(frame, location.folder) for frame in frames]
    size_px = images[0].size_px()
    return [
        Shot(
            image=image,
            lens=record_intrinsics(frame, size_px),
            world_from_camera=pose,
            time_s=time_s,
            camera=first_camera + camera,
        )
        for image, frame, pose, time_s, camera in zip(
            images, frames, poses, times_s, assign_camera_ids(poses, times_s), strict=True
        )
    ]


def _reason(held: Sequence[str], options: ReadOptions) -> str:
    if options.hold_out is not None:
        files = " and ".join(f"transforms_{split}.json" for split in held)
        return f"{files} held out, as asked for" if held else requested_reason(())
    if held:
        return f"transforms_{held[0]}.json held out, as given by the data set"
    return "every 8th time held out, by default: there is no transforms_test.json"


def _notes(location: CaptureLocation, held: Sequence[str]) -> tuple[str, ...]:
    notes = [
        f"transforms_{split}.json was left out" for split in _there(location) if split not in held
    ]
    notes.append("times are shares of the sequence, as in the files")
    if location.name.lower() == "lego":
        notes.append(_LEGO)
    return tuple(notes)


def _file(folder: Path, split: str) -> Path:
    return folder / f"transforms_{split}.json"


def _there(location: CaptureLocation) -> list[str]:
    """Splits that can be held out; the test split of the data set is first."""
    return [split for split in ("test", "val") if _file(location.folder, split).is_file()]
