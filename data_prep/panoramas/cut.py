"""Folders of photographs, cut from panoramas all around.

    panorama ─ exposure ─ views: yaw in even steps, random pitch, roll and field of view ─ PNG

A window of such a view shows the same place as the view, so they teach depth to be the same too.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from diff4splat.data_prep.panoramas.view import PanoramaView, panorama_view
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.atomic import atomic_folder
from diff4splat.io.photos.images import write_png
from diff4splat.io.pixels import from_bytes
from diff4splat.progress.phases import Phases

FOV_DEG = (55.0, 100.0)
PITCH_DEG, PITCH_SPREAD_DEG, ROLL_SPREAD_DEG = -6.0, 14.0, 6.0
"""People look slightly down, and hold a camera nearly level."""
MID_QUANTILE, MID_LEVEL, SHOULDER = 0.7, 0.6, 0.35
"""Radiance that becomes ``MID_LEVEL``; how strongly brighter ones are compressed."""
LEAST_CONTRAST = 12 / 255
"""Views with a smaller standard deviation show next to nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PanoramaJob:
    """Which panoramas, and what is cut from each."""

    panoramas: Sequence[Path]
    folder: Path
    views: int = 24
    size_px: int = 160
    seed: int = 0


def cut_panoramas(job: PanoramaJob, phases: Phases) -> int:
    """Write NAME-VIEW.png of every panorama; returns the number of files.

    Raises:
        FileFormatError: a file is damaged, or is no panorama of the whole sphere.
        InputError: two panoramas have one name.
    """
    _require_names(job.panoramas)
    written = 0
    with (
        phases.phase("cut panoramas", len(job.panoramas)) as advance,
        atomic_folder(job.folder) as folder,
    ):
        for place, file in enumerate(job.panoramas):
            panorama = read_panorama(file)
            for number, view in enumerate(random_views(job, place)):
                pixels = _reduced(panorama_view(panorama, view), job.size_px)
                if pixels.std() >= 255 * LEAST_CONTRAST:
                    name = f"{file.stem}-{number:03d}.png"
                    write_png(from_bytes(pixels), folder / name)
                    written += 1
            advance()
    return written


def _require_names(files: Sequence[Path]) -> None:
    (name, count), *_ = Counter(file.stem for file in files).most_common()
    if count > 1:
        raise InputError(
            f"panoramas: expected a name of its own for each, got {count} called {name}; "
            "rename them, or write them to several folders"
        )


def read_panorama(file: Path) -> UInt8[np.ndarray, "h w 3"]:
    """An equirectangular panorama; radiance of OpenEXR files is exposed.

    Raises:
        FileFormatError: damaged, or not twice as wide as high.
    """
    image = ImageFile(file=file)
    rgb = image.read().rgb
    if rgb.shape[1] != 2 * rgb.shape[0]:
        raise FileFormatError(
            f"{file}: expected a panorama of the whole sphere, twice as wide as high, got "
            f"{rgb.shape[1]} x {rgb.shape[0]}"
        )
    rgb = exposed(rgb) if image.is_float else rgb
    return (rgb * 255 + 0.5).astype(np.uint8)


def exposed(radiance: Float32[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    """sRGB-referred colours of radiance in any unit; NaN and negative values are black."""
    radiance = np.nan_to_num(radiance, nan=0.0, posinf=0.0).clip(0)
    middle = float(np.quantile(radiance, MID_QUANTILE))
    level = radiance * (MID_LEVEL / middle if middle > 0 else 1.0)
    return np.clip(level / (1 + SHOULDER * level), 0, 1) ** np.float32(1 / 2.2)


def random_views(job: PanoramaJob, place: int) -> list[PanoramaView]:
    """Views of the panorama at ``place``, of twice the sides that are written."""
    random = np.random.default_rng([job.seed, place])
    return [
        PanoramaView(
            size_px=(2 * job.size_px, 2 * job.size_px),
            fov_deg=random.uniform(*FOV_DEG),
            yaw_deg=360 * (number + random.random()) / job.views,
            pitch_deg=float(np.clip(random.normal(PITCH_DEG, PITCH_SPREAD_DEG), -80, 80)),
            roll_deg=random.normal(0, ROLL_SPREAD_DEG),
        )
        for number in range(job.views)
    ]


def _reduced(pixels: UInt8[np.ndarray, "h w 3"], size_px: int) -> UInt8[np.ndarray, "s s 3"]:
    return cv2.resize(pixels, (size_px, size_px), interpolation=cv2.INTER_AREA)
