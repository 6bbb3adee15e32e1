"""nerfstudio's ``transforms.json`` with a ``time`` per frame.

Poses have OpenGL camera axes. Beside each picture there may be a mask (black covers), depth, and
the file may name points to start from and which frames are for what
(https://docs.nerf.studio/quickstart/data_conventions.html). Fisheye frames stay fisheye frames.
"""

import posixpath
from dataclasses import replace
from pathlib import Path

from diff4splat.data.capture.capture import PointCloud
from diff4splat.data_prep.readers.camera_numbers import camera_numbers
from diff4splat.data_prep.readers.depth_file import DepthFile
from diff4splat.data_prep.readers.holding_out import hold_out
from diff4splat.data_prep.readers.json_file import texts
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.places import Place, inside
from diff4splat.data_prep.readers.points import read_cloud
from diff4splat.data_prep.readers.shots import Draft, Shot
from diff4splat.data_prep.readers.transform_lenses import lens_of
from diff4splat.data_prep.readers.transform_records import (
    file_name,
    load_frames,
    picture_of,
    poses_of,
    time_of,
)
from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_fields import FrameRecord, optional_number

LOOKS_LIKE = "transforms.json (nerfstudio, with a 'time' for every frame)"

_HELD, _LEARNT = ("val_filenames", "test_filenames"), "train_filenames"
_NO_TIME = "add the seconds of every picture, or give fps if the frames stand in order of time"


def matches(folder: Path) -> bool:
    """Whether ``folder`` looks like it."""
    return (folder / "transforms.json").is_file()


def read(place: Place, options: ReadOptions) -> Draft:
    """What the file says.

    Raises:
        FileFormatError: naming the file and frame.
        ConfigError: cameras are to be held out that are not there.
    """
    file = place.file or place.folder / "transforms.json"
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
        shots, reason = hold_out(shots, options.hold_out, place.name)
    points, cloud_notes = _points(root, file)
    return Draft(
        name=place.name,
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
    folder, poses, times_s = file.parent, poses_of(frames, file), _times_s(frames, fps)
    unit = optional_number(root, "depth_unit_scale_factor", str(file))
    pictures = [picture_of(frame, folder) for frame in frames]
    size_px = pictures[0].size_px()
    shots = [
        Shot(
            picture=picture,
            lens=lens_of(frame, size_px),
            world_from_camera=pose,
            time_s=time_s,
            camera=camera,
            mask=_beside(frame, "mask_path", folder),
        )
        for picture, frame, pose, time_s, camera in zip(
            pictures, frames, poses, times_s, camera_numbers(poses, times_s), strict=True
        )
    ]
    depths = [_beside(frame, "depth_file_path", folder) for frame in frames]
    return [
        shot
        if depth is None or shot.lens.is_angular
        else replace(shot, depth=DepthFile(file=depth, unit=unit))
        for shot, depth in zip(shots, depths, strict=True)
    ]


def _times_s(frames: list[FrameRecord], fps: float | None) -> list[float]:
    if fps is not None and all(frame.fields.get("time") is None for frame in frames):
        return [index / fps for index in range(len(frames))]
    return [time_of(frame, _NO_TIME) for frame in frames]


def _time_note(frames: list[FrameRecord], fps: float | None) -> tuple[str, ...]:
    if frames[0].fields.get("time") is not None:
        return ()
    return (f"the file has no times: its order was taken as {fps:g} frames per second",)


def _depth_note(frames: list[FrameRecord], shot: Shot) -> tuple[str, ...]:
    """Rays have length one in nerfstudio where pixels are angles, so depth there is distance."""
    given = any(frame.fields.get("depth_file_path") is not None for frame in frames)
    if not (given and shot.lens.is_angular):
        return ()
    return ("distances were left out: depth is z",)


def _beside(frame: FrameRecord, key: str, folder: Path) -> Path | None:
    """The file under ``key``, if the frame names one."""
    if frame.fields.get(key) is None:
        return None
    file = inside(folder, file_name(frame, key), frame.where)
    if not file.is_file():
        raise FileFormatError(
            f"{frame.where}: '{key}': expected the file {file}, got no such file; copy it again"
        )
    return file


def _points(root: dict[str, object], file: Path) -> tuple[PointCloud | None, tuple[str, ...]]:
    name = root.get("ply_file_path")
    if not isinstance(name, str):
        return None, ()
    return read_cloud(inside(file.parent, name, str(file)))


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
    """Frames of the lists; where one side has no list, it is all that the other has not."""
    learnt, held = lists[_LEARNT], lists[_HELD[0]] | lists[_HELD[1]]
    learnt, held = learnt or set(names) - held, held or set(names) - learnt
    kept = [
        replace(shot, held_out=name in held)
        for shot, name in zip(shots, names, strict=True)
        if name in held | learnt
    ]
    left = len(shots) - len(kept)
    return kept, (f"{left} frames that are in no list were left out",) if left else ()
