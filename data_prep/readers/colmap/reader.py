"""Captures with a COLMAP model: several static cameras, or one moving camera.

Several cameras have folders ``cam01``, ``cam02`` and so on (also within ``images``); otherwise the
images of one folder are a video. Times are frame numbers. The layout has no test split: the images
that its tools call test are training images.
"""

from pathlib import Path

from diff4splat.data_prep.readers.camera_rig.rig import RIG_FPS, fps_note
from diff4splat.data_prep.readers.colmap.model import Model, model_folder
from diff4splat.data_prep.readers.colmap.read_model import read_model
from diff4splat.data_prep.readers.colmap.rig_images import read_rig
from diff4splat.data_prep.readers.colmap.video_images import image_folder, read_video
from diff4splat.data_prep.readers.common.test_split import choose_test_split
from diff4splat.data_prep.readers.common.undecoded_capture import UndecodedCapture
from diff4splat.data_prep.readers.files.file_discovery import CaptureLocation, camera_folders
from diff4splat.data_prep.readers.files.point_cloud import (
    CloudWithNotes,
    cloud_from_arrays,
    find_cloud,
)
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.errors import FileFormatError

EXPECTED_FILES = (
    "cameras and images (.bin or .txt) of COLMAP in sparse/0, sparse, sparse_ or colmap/sparse/0, "
    "beside cam01/, cam02/, ... or images/"
)

_CLOUDS = ("points3D_multipleview.ply", "points3D_downsample2.ply", "points3D.ply")
_NO_TEST = "; what this layout's tools call test are training images, so they are not used as one"


def matches(folder: Path) -> bool:
    """Whether ``folder`` has this format."""
    return model_folder(folder) is not None and bool(_cameras(folder) or image_folder(folder))


def read(location: CaptureLocation, options: ReadOptions) -> UndecodedCapture:
    """Read the capture.

    Raises:
        FileFormatError: the model is missing or damaged, or does not fit the images.
        ConfigError: cameras are to be held out that are not there.
    """
    sparse = model_folder(location.folder)
    folders, images = _cameras(location.folder), image_folder(location.folder)
    if sparse is None or not (folders or images):
        raise FileFormatError(
            f"{location.folder}: expected {EXPECTED_FILES}, got less; check the folder"
        )
    model, fps = read_model(sparse), options.fps or RIG_FPS
    if folders:
        shots, notes = read_rig(model, folders, fps)
    else:
        shots, notes = read_video(model, images, fps)
    shots, reason = choose_test_split(shots, options.hold_out, location.name)
    points, cloud_notes = _points(model, location.folder)
    return UndecodedCapture(
        name=location.name,
        source="COLMAP",
        shots=shots,
        split_reason=reason + (_NO_TEST if folders and options.hold_out is None else ""),
        shrink=options.downscale,
        points=points,
        background=options.background,
        notes=(*notes, *fps_note(options.fps, RIG_FPS), *cloud_notes),
    )


def _cameras(folder: Path) -> dict[str, Path]:
    images = folder / "images"
    return camera_folders(folder) or (camera_folders(images) if images.is_dir() else {})


def _points(model: Model, folder: Path) -> CloudWithNotes:
    points, notes = cloud_from_arrays(model.positions, model.rgb, str(model.folder / "points3D"))
    if points is not None:
        return points, notes
    cloud, more = find_cloud(folder, _CLOUDS)
    return cloud, (*notes, *more)
