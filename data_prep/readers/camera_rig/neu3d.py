"""Neural 3D Video (DyNeRF): ``poses_bounds.npy`` and a video, or numbered images, per camera.

Rows are in the order of the cameras' names. Camera 0 is the test camera
(Li et al., CVPR 2022).
"""

from dataclasses import replace
from pathlib import Path

from diff4splat.data_prep.readers.camera_rig.llff_poses import read_llff
from diff4splat.data_prep.readers.camera_rig.rig import (
    RIG_FPS,
    Rig,
    fps_note,
    rig_from_folders,
    rig_shots,
)
from diff4splat.data_prep.readers.common.test_split import MIN_CAMERAS, choose_test_split
from diff4splat.data_prep.readers.common.undecoded_capture import Shot, UndecodedCapture
from diff4splat.data_prep.readers.files.file_discovery import (
    CaptureLocation,
    camera_folders,
    camera_videos,
)
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.point_cloud import find_cloud
from diff4splat.data_prep.readers.files.video_file import CACHE_BYTES, VideoFile, VideoFrame
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import FileFormatError

EXPECTED_FILES = "poses_bounds.npy beside cam00.mp4, cam01.mp4, ... or cam00/images/0000.png, ..."

_CLOUDS = ("points3D_downsample2.ply", "points3D_downsample.ply", "points3D.ply")
"""Triangulated with the given poses, and so in their world."""
_OUT_OF_STEP = (
    "cam13 of coffee_martini is known to run out of step with the others; if it is here, remove it "
    "and its row"
)


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    return (folder / "poses_bounds.npy").is_file() and bool(
        camera_videos(folder) or camera_folders(folder)
    )


def read(location: CaptureLocation, options: ReadOptions) -> UndecodedCapture:
    """Read the capture.

    Raises:
        FileFormatError: the array is damaged, or its rows are not the cameras.
        ConfigError: cameras are to be held out that are not there.
    """
    rig, notes = _rig(location.folder, options.downscale)
    videos = _videos_of(rig)
    fps, fps_notes = _fps(options.fps, videos)
    poses, lenses = read_llff(location.folder / "poses_bounds.npy", rig.names)
    shots = [_at_video_size(shot) for shot in rig_shots(rig, poses, lenses, fps)]
    shots, reason = choose_test_split(shots, options.hold_out, location.name)
    if options.hold_out is None and len(rig.names) >= MIN_CAMERAS:
        reason = "camera 0 held out, as given by the data set"
    points, cloud_notes = find_cloud(location.folder, _CLOUDS)
    warning = (_OUT_OF_STEP,) if "coffee_martini" in location.name.lower() else ()
    return UndecodedCapture(
        name=location.name,
        source="Neural 3D Video",
        shots=shots,
        split_reason=reason,
        shrink=1 if videos else options.downscale,
        points=points,
        background=options.background,
        notes=(*notes, *rig.notes(), *fps_notes, *cloud_notes, *warning),
    )


def _rig(folder: Path, shrink: int) -> tuple[Rig, tuple[str, ...]]:
    """Images if every camera has them, since they allow random access; else videos."""
    folders, videos = camera_folders(folder), camera_videos(folder)
    if not folders and not videos:
        raise FileFormatError(
            f"{folder}: expected videos or images of cameras (cam00.mp4 or cam00/images), got "
            "none; check the folder"
        )
    if set(folders) >= set(videos):
        notes = ("images were taken and videos left out",) if videos else ()
        return rig_from_folders(folders), notes
    only = sorted(set(folders) - set(videos))
    if only:
        raise FileFormatError(
            f"{folder}: expected a video for every camera, or images for every camera, got "
            f"images but no video of {only[0]} and a video but no images of "
            f"{min(set(videos) - set(folders))}; add what is missing"
        )
    return _rig_of_videos(videos, shrink), ()


def _rig_of_videos(files: dict[str, Path], shrink: int) -> Rig:
    cache = LruCache(CACHE_BYTES)
    videos = {name: VideoFile(file, shrink, cache) for name, file in files.items()}
    return Rig(
        by_camera={
            name: {index: VideoFrame(video=video, frame=index) for index in range(video.frames)}
            for name, video in videos.items()
        }
    )


def _videos_of(rig: Rig) -> list[VideoFile]:
    firsts = [next(iter(images.values())) for images in rig.by_camera.values()]
    return [first.video for first in firsts if isinstance(first, VideoFrame)]


def _fps(asked: float | None, videos: list[VideoFile]) -> tuple[float, tuple[str, ...]]:
    """Frames per second, and a note where they were assumed.

    Raises:
        FileFormatError: the videos run at different rates.
    """
    rates = sorted({round(video.fps, 3) for video in videos})
    if asked is not None:
        return asked, ()
    if len(rates) > 1:
        raise FileFormatError(
            f"{videos[0].file.parent}: expected videos of one frame rate, got {rates[0]:g} to "
            f"{rates[-1]:g}; make them alike, or give fps"
        )
    if not rates or not 0 < rates[0] < float("inf"):
        return RIG_FPS, fps_note(asked, RIG_FPS)
    return videos[0].fps, ()


def _at_video_size(shot: Shot) -> Shot:
    """The shot with the intrinsics of its downscaled video."""
    if not isinstance(shot.image, VideoFrame):
        return shot
    video = shot.image.video
    lens = shot.lens.scaled_to(video.full_size_px, str(video.file)).downscaled(video.shrink)
    return replace(shot, lens=lens)
