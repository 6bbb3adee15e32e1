"""nerfstudio's ``transforms.json`` with a ``time`` per frame.

Poses have OpenGL camera axes. An image may have a mask (black is invalid) and depth, and
the file may name initial points and a split
(https://docs.nerf.studio/quickstart/data_conventions.html). Fisheye frames stay fisheye frames.
"""

import posixpath
from dataclasses import replace
from pathlib import Path

from diff4splat.data.capture.capture import PointCloud
from diff4splat.data_prep.readers.common.camera_ids import assign_camera_ids
from diff4splat.data_prep.readers.common.test_split import choose_test_split
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.files.depth_file import DepthFile
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation, resolve_inside
from diff4splat.data_prep.readers.files.json_file import texts
from diff4splat.data_prep.readers.files.point_cloud import read_cloud
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.transforms.frame_records import (
    file_name,
    load_frames,
    record_image,
    record_poses,
    record_time_s,
)
from diff4splat.data_prep.readers.transforms.lenses import record_intrinsics
from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_fields import FrameRecord, optional_number

EXPECTED_FILES = "transforms.json (nerfstudio, with a 'time' for every frame)"

_HELD, _LEARNT = ("val_filenames", "test_filenames"), "train_filenames"
_NO_TIME = "add the seconds of every image, or give fps if the frames stand in order of time"


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    return (folder / "transforms.json").is_file()


def read(location: CaptureLocation, options: ReadOptions) -> UndecodedCapture:
    """Read the capture.

    Raises:
        FileFormatError: naming the file and frame.
        ConfigError: cameras are to be held out that are not there.
    """
    file = location.file or location.folder / "transforms.json"
    root, frames = load_frames(file)
    shots = _shots(file, root, frames, options.fps)
    lists = {key: set(map(_plain, texts(root, key, str(file)))) for key in (*_HELD, _LEARNT)}
    notes: tuple[str, ...] = ()
    if options.hold_out is None and any(lists.values()):
        names = [_plain(file_name(frame, "file_path")) for frame in frames]
        _require_known(lists, names, file)
        shots, notes = _split(shots, names, lists)
        reason = f"lists of frames in {file.name}"
    else:
        shots, reason = choose_test_split(shots, options.hold_out, location.name)
    points, cloud_notes = _points(root, file)
    return UndecodedCapture(
        name=location.name,
        source="nerfstudio",
        shots=shots,
        split_reason=reason,
        shrink=options.downscale,
        points=points,
        background=options.background,
        notes=(
            *notes,
            *cloud_notes,
            *_time_note(frames, options.fps),
            *_depth_note(frames, shots[0]),
        ),
    )


def _shots(
    file: Path, root: dict[str, object], frames: list[FrameRecord], fps: float | None
) -> list[Shot]:
    folder, poses, times_s = file.parent, record_poses(frames, file), _times_s(frames, fps)
    unit = optional_number(root, "depth_unit_scale_factor", str(file))
    images = [record_image(frame, folder) for frame in frames]
    size_px = images[0].size_px()
    shots = [
        Shot(
            image=image,
            lens=record_intrinsics(frame, size_px),
            world_from_camera=pose,
            time_s=time_s,
            camera=camera,
            mask=_beside(frame, "mask_path", folder),
        )
        for image, frame, pose, time_s, camera in zip(
            images, frames, poses, times_s, assign_camera_ids(poses, times_s), strict=True
        )
    ]
    depths = [_beside(frame, "depth_file_path", folder) for frame in frames]
    return [
        shot
        if depth is None or shot.lens.keeps_projection
        else replace(shot, depth=DepthFile(file=depth, unit=unit))
        for shot, depth in zip(shots, depths, strict=True)
    ]


def _times_s(frames: list[FrameRecord], fps: float | None) -> list[float]:
    if fps is not None and all(frame.fields.get("time") is None for frame in frames):
        return [index / fps for index in range(len(frames))]
    return [record_time_s(frame, _NO_TIME) for frame in frames]


def _time_note(frames: list[FrameRecord], fps: float | None) -> tuple[str, ...]:
    if frames[0].fields.get("time") is not None:
        return ()
    return (f"the file has no times: its order was taken as {fps:g} frames per second",)


def _depth_note(frames: list[FrameRecord], shot: Shot) -> tuple[str, ...]:
    """Depth of fisheye and equirectangular frames is distance in nerfstudio, not z."""
    given = any(frame.fields.get("depth_file_path") is not None for frame in frames)
    if not (given and shot.lens.keeps_projection):
        return ()
    return ("distances were left out: depth is z",)


def _beside(frame: FrameRecord, key: str, folder: Path) -> Path | None:
    """The file under ``key``, if the frame names one."""
    if frame.fields.get(key) is None:
        return None
    file = resolve_inside(folder, file_name(frame, key), frame.where)
    if not file.is_file():
        raise FileFormatError(
            f"{frame.where}: '{key}': expected the file {file}, got no such file; copy it again"
        )
    return file


def _points(root: dict[str, object], file: Path) -> tuple[PointCloud | None, tuple[str, ...]]:
    name = root.get("ply_file_path")
    if not isinstance(name, str):
        return None, ()
    return read_cloud(resolve_inside(file.parent, name, str(file)))


def _plain(name: str) -> str:
    return posixpath.normpath(name)


def _require_known(lists: dict[str, set[str]], names: list[str], file: Path) -> None:
    for key, wanted in lists.items():
        unknown = sorted(wanted - set(names))
        if unknown:
            raise FileFormatError(
                f"{file}: '{key}': expected the file_path of frames, got '{unknown[0]}', which no "
                "frame has; repair the list"
            )


def _split(
    shots: list[Shot], names: list[str], lists: dict[str, set[str]]
) -> tuple[list[Shot], tuple[str, ...]]:
    """Frames of the lists; a missing list is the complement of the other."""
    learnt, held = lists[_LEARNT], lists[_HELD[0]] | lists[_HELD[1]]
    learnt, held = learnt or set(names) - held, held or set(names) - learnt
    kept = [
        replace(shot, held_out=name in held)
        for shot, name in zip(shots, names, strict=True)
        if name in held | learnt
    ]
    left = len(shots) - len(kept)
    return kept, (f"{left} frames that are in no list were left out",) if left else ()
