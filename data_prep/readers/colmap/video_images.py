"""One moving camera: the images of one folder in the order of time, with poses from COLMAP.

Time counts all images of the folder. An image without a pose is skipped and leaves a gap.
"""

from pathlib import Path

from diff4splat.data_prep.readers.colmap.model import Model
from diff4splat.data_prep.readers.colmap.read_model import camera_intrinsics, image_poses
from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.data_prep.readers.files.file_discovery import (
    images_below,
    natural_key,
    resolve_inside,
)
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.errors import FileFormatError

IMAGE_FOLDERS = ("images", "input", "rgb", "frames")


def image_folder(folder: Path) -> Path | None:
    """The folder with the images of a video; None without one."""
    for name in IMAGE_FOLDERS:
        if (folder / name).is_dir() and images_below(folder / name):
            return folder / name
    return None


def read_video(model: Model, folder: Path, fps: float) -> tuple[list[Shot], tuple[str, ...]]:
    """Every image of the model in the order of time, and notes.

    Raises:
        FileFormatError: an image is missing or lies elsewhere.
    """
    places = {file: index for index, file in enumerate(images_below(folder))}
    images = sorted(model.images, key=lambda image: natural_key(image.name))
    shots = []
    for image, pose in zip(images, image_poses(images, model.folder), strict=True):
        file = resolve_inside(folder, image.name, f"{model.folder}: image")
        if file not in places:
            raise FileFormatError(
                f"{model.folder}: '{image.name}': expected the image {file}, got no such file; "
                "copy it again"
            )
        shots.append(
            Shot(
                image=ImageFile(file=file),
                lens=camera_intrinsics(
                    model.cameras[image.camera], f"{model.folder}: {image.name}"
                ),
                world_from_camera=pose,
                time_s=places[file] / fps,
                camera=0,
            )
        )
    without = len(places) - len(shots)
    note = f"{without} of {len(places)} images left out: COLMAP found no pose for them"
    return shots, (note,) if without else ()
