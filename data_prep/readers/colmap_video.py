"""One moving camera: the pictures of one folder in the order of time, with poses from COLMAP.

Time counts all pictures of the folder: one that COLMAP found no pose for is left out but leaves its
gap, so that what follows keeps its time.
"""

from pathlib import Path

from diff4splat.data_prep.readers.colmap_model import Model
from diff4splat.data_prep.readers.colmap_read import lens_of, poses_of
from diff4splat.data_prep.readers.picture_file import PictureFile
from diff4splat.data_prep.readers.places import inside, natural_key, pictures_below
from diff4splat.data_prep.readers.shots import Shot
from diff4splat.errors import FileFormatError

PICTURE_FOLDERS = ("images", "input", "rgb", "frames")


def picture_folder(folder: Path) -> Path | None:
    """Where the pictures of a video lie, if they do."""
    for name in PICTURE_FOLDERS:
        if (folder / name).is_dir() and pictures_below(folder / name):
            return folder / name
    return None


def read_video(model: Model, folder: Path, fps: float) -> tuple[list[Shot], tuple[str, ...]]:
    """Every image of the model in the order of time, and notes.

    Raises:
        FileFormatError: a picture is missing or lies elsewhere.
    """
    places = {file: index for index, file in enumerate(pictures_below(folder))}
    images = sorted(model.images, key=lambda image: natural_key(image.name))
    shots = []
    for image, pose in zip(images, poses_of(images, model.folder), strict=True):
        file = inside(folder, image.name, f"{model.folder}: image")
        if file not in places:
            raise FileFormatError(
                f"{model.folder}: '{image.name}': expected the picture {file}, got no such file; "
                "copy it again"
            )
        shots.append(
            Shot(
                picture=PictureFile(file=file),
                lens=lens_of(model.cameras[image.camera], f"{model.folder}: {image.name}"),
                world_from_camera=pose,
                time_s=places[file] / fps,
                camera=0,
            )
        )
    without = len(places) - len(shots)
    note = f"{without} of {len(places)} pictures left out: COLMAP found no pose for them"
    return shots, (note,) if without else ()
