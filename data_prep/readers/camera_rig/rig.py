"""Rigs of cameras ``cam00``, ``cam01`` and so on, with images numbered by time.

The number of an image is its time, so a missing image leaves a gap. The first number of the rig, 0
or 1, is time 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.data_prep.readers.files.file_discovery import images_in, last_number
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.files.video_file import VideoFrame
from diff4splat.errors import FileFormatError

RIG_FPS = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """The images of every camera by number; cameras in the order of their names."""

    by_camera: dict[str, dict[int, ImageFile | VideoFrame]]

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""
        return list(self.by_camera)

    def notes(self) -> tuple[str, ...]:
        """Which cameras lack images that others have, and how cameras are counted."""
        every = set().union(*self.by_camera.values())
        lacking = {name: len(every) - len(found) for name, found in self.by_camera.items()}
        return (
            *(f"{name} lacks {n} of {len(every)} images" for name, n in lacking.items() if n),
            *_counting(self.names),
        )


def rig_from_folders(folders: Mapping[str, Path]) -> Rig:
    """The numbered images in the folder of each camera.

    Raises:
        FileFormatError: an image has no number, or two have the same.
    """
    return Rig(by_camera={name: _numbered(folder) for name, folder in folders.items()})


def rig_shots(
    rig: Rig, poses: Float[Tensor, "c 4 4"], lenses: Sequence[Intrinsics], fps: float
) -> list[Shot]:
    """Every image of static cameras, camera by camera in the order of time."""
    first = min(min(images) for images in rig.by_camera.values())
    return [
        Shot(
            image=images[number],
            lens=lenses[camera],
            world_from_camera=poses[camera],
            time_s=(number - first) / fps,
            camera=camera,
        )
        for camera, images in enumerate(rig.by_camera.values())
        for number in sorted(images)
    ]


def fps_note(fps: float | None, default: float) -> tuple[str, ...]:
    """A note if the frame rate is an assumption."""
    if fps is not None:
        return ()
    return (f"times: {default:g} frames per second were assumed; give fps if it was another rate",)


def _counting(names: list[str]) -> tuple[str, ...]:
    if [last_number(name) for name in names] == list(range(len(names))):
        return ()
    pairs = ", ".join(f"{name} is {number}" for number, name in enumerate(names))
    return (f"cameras count from 0 in the order of their names: {pairs}",)


def _numbered(folder: Path) -> dict[int, ImageFile]:
    found: dict[int, ImageFile] = {}
    for file in images_in(folder):
        number = last_number(file.name)
        if number is None or number in found:
            got = "no number" if number is None else f"that of {found[number].file.name} again"
            raise FileFormatError(
                f"{file}: expected images numbered by time, such as frame_00001.jpg, got {got}; "
                "rename or remove it"
            )
        found[number] = ImageFile(file=file)
    return found
