"""Where the photographs come from: files of installed packages, and views cut from panoramas.

Axes: ``h w`` pixels.
"""

import importlib.resources
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.data_prep.panoramas.view import PanoramaView, panorama_view
from diff4splat.errors import InputError

Image = UInt8[np.ndarray, "h w 3"]
VIEW_PX, VIEW_FOV_DEG = (288, 384), 70.0
"""Height and width of a view of a panorama, and its horizontal field of view."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A file of an installed package; a panorama if it says where to look."""

    name: str
    package: str
    """Empty for a file outside of packages."""
    file: str
    yaw_deg: float | None = None
    """To the right of the middle of a panorama."""
    pitch_deg: float = 0.0
    """Upward."""

    @property
    def fov_deg(self) -> float | None:
        """Known for views of panoramas alone."""
        return None if self.yaw_deg is None else VIEW_FOV_DEG


def _panorama(name: str, yaw_deg: float, pitch_deg: float = -5.0) -> Photograph:
    return Photograph(
        name=name.replace("_1k", "").replace("_", " "),
        package="viser",
        file=f"_assets/hdri/{name}.jpg",
        yaw_deg=yaw_deg,
        pitch_deg=pitch_deg,
    )


PHOTOGRAPHS = (
    *(
        Photograph(name=name, package="skimage", file=f"data/{name}.{kind}")
        for name, kind in (
            ("astronaut", "png"), ("coffee", "png"), ("chelsea", "png"), ("rocket", "jpg"),
            ("camera", "png"), ("motorcycle_left", "png"),
        )
    ),
    Photograph(name="grace hopper", package="matplotlib",
               file="mpl-data/sample_data/grace_hopper.jpg"),
    _panorama("empty_warehouse_01_1k", -50.0),
    _panorama("forest_slope_1k", -95.0),
    _panorama("potsdamer_platz_1k", 20.0),
    _panorama("st_fagans_interior_1k", -15.0, -10.0),
    _panorama("venice_sunset_1k", 150.0),
)  # fmt: skip
"""Portraits, close-ups, animals, machines, interiors, streets, woods."""


def of_folder(folder: Path) -> tuple[Photograph, ...]:
    """Every JPEG and PNG image in it, by name.

    Raises:
        InputError: there is none.
    """
    endings = (".jpg", ".jpeg", ".png")
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() in endings)
    if not files:
        raise InputError(
            f"photographs: expected JPEG or PNG files in {folder}, got none; name another folder"
        )
    return tuple(Photograph(name=file.stem, package="", file=str(file)) for file in files)


def load(photograph: Photograph) -> Image:
    """Its pixels, red first.

    Raises:
        InputError: the package that has the file is not installed.
    """
    try:
        package = photograph.package
        root = importlib.resources.files(package) if package else Path()
        file = root.joinpath(photograph.file)
        pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    except (ModuleNotFoundError, FileNotFoundError) as error:
        raise InputError(
            f"{photograph.name}: expected {photograph.file} of the package {photograph.package}, "
            f"got none; install {photograph.package}"
        ) from error
    rgb = np.ascontiguousarray(pixels[..., ::-1])
    if photograph.yaw_deg is None:
        return rgb
    view = PanoramaView(
        size_px=VIEW_PX,
        fov_deg=VIEW_FOV_DEG,
        yaw_deg=photograph.yaw_deg,
        pitch_deg=photograph.pitch_deg,
    )
    return panorama_view(rgb, view)
